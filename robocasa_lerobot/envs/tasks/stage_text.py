"""What a stage is called in an episode: a short imperative sentence, with the words of the instruction."""

from __future__ import annotations

from collections.abc import Callable

from robocasa_lerobot.envs.kitchens.appliances.kinds.coffee_machine import CoffeeMachine
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.regions import ANY_LEVEL
from robocasa_lerobot.envs.predicates.heat_and_water import UnderWater
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.words import said
from robocasa_lerobot.envs.tasks.task import Stage

_DEEP_M = 0.04  # an object is put into deeper receptacles, not on them
# Parts of appliances that have another name in speech; others are called by their name without underscores.
_PARTS = {
    "knob_temp": "temperature knob",
    "knob_time": "timer knob",
    "knob_speed": "speed knob",
    "handle_temp": "handle",
    "rack": "rack",
    "receptacle": "dispenser",
}
_DIRECTIONS = {"increase": "up", "decrease": "down"}


def stage_text(stage: Stage, scene: Scene) -> str:
    """The stage's own text, or that of its verb, filled with what this scene has; e.g. "open the door of the fridge".

    Words are those of `Scene.words`: kinds of fixtures and objects, and of what was drawn; never ids.
    """
    wording = stage.text or _BY_VERB.get((stage.skill, stage.verb), _plainly)(stage, scene)
    return said(wording, scene.words)


def _target(stage: Stage, scene: Scene) -> str:
    return _word(stage.target, scene)


def _object(stage: Stage, scene: Scene) -> str:
    return _word(stage.object, scene)


def _word(name: str, scene: Scene) -> str:
    """What an object or the fixture of a role is called; a part of one, `<fixture>_lid`, by its part alone."""
    for role in scene.roles:
        name = name.replace(f"{{{role}}}_", "")
    name = scene.fill(name) if "{" in name else name
    word = scene.words.get(name, _spaced(name))
    return "cabinet" if name in scene.roles and word.endswith("cabinet") else word


def _part(stage: Stage, scene: Scene) -> str:
    """What the part is called; a drawn one by the word of its choice."""
    for choice in (choice for choice in scene.words if f"{{{choice}}}" in stage.part):
        kind = stage.part.replace(f"{{{choice}}}", "").strip("_") or choice
        word = scene.words[choice]
        if word == scene.choices.get(choice) and _has_digit(word):  # an id that nobody gave a word
            word = ""
        kind = _spaced("burner" if kind == "knob" else kind)
        return word if kind in word.split() else f"{word} {kind}".strip()
    part = scene.fill(stage.part)
    if part.startswith("knob_") and part not in _PARTS:
        return _spaced(part.removeprefix("knob_")) + " burner"
    return _PARTS.get(part.rstrip("0123456789"), _spaced(part))


def _has_digit(text: str) -> bool:
    return any(character.isdigit() for character in text)


def _spaced(name: str) -> str:
    return " ".join(name.rstrip("0123456789").replace("_", " ").split())


def _to(stage: Stage, scene: Scene) -> str:
    """The direction; a drawn one by the word of its choice."""
    direction = stage.to
    for name, word in scene.words.items():
        direction = direction.replace(f"{{{name}}}", word)
    return _DIRECTIONS.get(scene.fill(direction), scene.fill(direction))


def _doors(stage: Stage, scene: Scene) -> str:
    """The doors of a fixture, or of the compartment that is named."""
    fixture, target = scene.fixture(stage.target), _target(stage, scene)
    if stage.part in fixture.compartments:
        several = len(fixture.doors_of(stage.part)) > 1
        target = stage.part if stage.part == target else f"{stage.part} of the {target}"
        return f"{'doors' if several else 'door'} of the {target}"
    if stage.part:
        return f"{_part(stage, scene)} of the {target}"
    return f"{'doors' if len(fixture.door_names) > 1 else 'door'} of the {target}"


def _holding(stage: Stage, scene: Scene) -> str:
    """Into or onto the target: by the depth of its interior."""
    placed = scene.objects.get(stage.target)
    interior = None if placed is None else placed.item.interior
    deep = interior is not None and 2 * interior.half[2] > _DEEP_M
    return f"{'into' if deep else 'on'} the {_target(stage, scene)}"


def _inside(stage: Stage, scene: Scene) -> str:
    """Into the target, or onto the part of it that is named."""
    target = _target(stage, scene)
    if not stage.part:
        return f"into the {target}"
    shelf, _, level = scene.fill(stage.part).partition(":")
    if shelf.endswith("shelf"):
        room = shelf.removesuffix("_shelf")
        which = "a" if level in ("", ANY_LEVEL) else f"the {level.replace('_', ' ')}"
        return f"on {which} shelf of the {room if room in scene.fixture(stage.target).compartments else target}"
    part = _part(stage, scene)
    return f"{'into' if part.endswith('drawer') else 'on'} the {part} of the {target}"


def _placed(stage: Stage, scene: Scene) -> str:
    """Where an object is put: on, into or under the target, as one says it of its kind."""
    if scene.fill(stage.target) in scene.objects:
        return _holding(stage, scene)
    match scene.fixture(stage.target):
        case Counter():
            return f"on the {_target(stage, scene)}"
        case CoffeeMachine():
            return f"under the {_part(stage, scene)} of the {_target(stage, scene)}"
        case Hob() if not stage.part:
            return f"on a burner of the {_target(stage, scene)}"
        case _:
            return _inside(stage, scene)


def _knob(stage: Stage, scene: Scene) -> str:
    """A knob, or the burner under the object that a stage names."""
    if stage.object:
        return f"burner under the {_object(stage, scene)}"
    return f"{_part(stage, scene)} of the {_target(stage, scene)}"


def _held(stage: Stage, scene: Scene) -> str:
    """Where an object is held: under the faucet, if it is to be under water."""
    wet = stage.until is not None and any(isinstance(goal, UnderWater) for goal in every_goal_in(stage.until))
    return f"hold the {_object(stage, scene)} {'under the faucet of' if wet else 'at'} the {_target(stage, scene)}"


def _driven(stage: Stage, scene: Scene) -> str:
    target = _target(stage, scene)
    return f"carry the {_object(stage, scene)} to the {target}" if stage.object else f"go to the {target}"


def _plainly(stage: Stage, scene: Scene) -> str:
    """For verbs that have no wording of their own."""
    verb = stage.verb.replace("_", " ")
    if stage.object:
        return f"{verb} the {_object(stage, scene)}"
    part = f"{_part(stage, scene)} of the " if stage.part else ""
    return f"{verb} the {part}{_target(stage, scene)}"


type _Wording = Callable[[Stage, Scene], str]


def _parted(pattern: str) -> _Wording:
    """With {part}, {target}, {object}, {to}, {doors}, {placed} and {knob}, each made where it is named."""
    makers = {
        "part": _part, "target": _target, "object": _object, "to": _to, "doors": _doors,
        "placed": _placed, "knob": _knob,
    }  # fmt: skip
    used = {name: make for name, make in makers.items() if f"{{{name}}}" in pattern}
    return lambda stage, scene: pattern.format(**{name: make(stage, scene) for name, make in used.items()})


def _turned(stage: Stage, scene: Scene) -> str:
    part = "spout" if stage.part == "spout" else "handle"
    return f"turn the {part} of the {_target(stage, scene)} to the {_to(stage, scene)}"


_BY_VERB: dict[tuple[str, str], _Wording] = {
    ("doors", "open"): _parted("open the {doors}"),
    **dict.fromkeys(
        (("doors", "close"), ("doors", "close_large"), ("doors", "lift_shut"), ("doors", "lift_low")),
        _parted("close the {doors}"),
    ),
    ("doors", "raise_head"): _parted("raise the head of the {target}"),
    ("doors", "lower_head"): _parted("lower the head of the {target}"),
    ("doors", "push_lid"): _parted("close the lid of the {target}"),
    ("drawers", "open"): _parted("open the {target}"),
    ("drawers", "close"): _parted("close the {target}"),
    ("racks", "slide"): _parted("slide the {part} of the {target} {to}"),
    ("racks", "pull"): _parted("pull the {part} of the {target} out"),
    ("racks", "push"): _parted("push the {part} of the {target} in"),
    ("navigation", "drive"): _driven,
    ("buttons", "press"): _parted("press the {part} of the {target}"),
    ("levers", "press"): _parted("press the {part} of the {target}"),
    ("knobs", "on"): _parted("turn on the {knob}"),
    ("knobs", "off"): _parted("turn off the {knob}"),
    ("knobs", "low"): _parted("turn the {part} of the {target} down to low"),
    ("knobs", "medium"): _parted("turn the {knob} to a medium flame"),
    ("knobs", "lowest"): _parted("turn the {part} of the {target} all the way down"),
    ("knobs", "highest"): _parted("turn the {part} of the {target} all the way up"),
    ("knobs", "raise"): _parted("turn up the {part} of the {target}"),
    ("knobs", "turn"): _parted("turn the {part} of the {target} {to}"),
    ("levers", "on"): _parted("turn on the faucet of the {target}"),
    ("levers", "hot"): _parted("let hot water run from the faucet of the {target}"),
    ("levers", "off"): _parted("turn off the faucet of the {target}"),
    ("levers", "turn"): _turned,
    ("pick_place", "pick"): _parted("pick up the {object}"),
    ("pick_place", "place"): _parted("put the {object} {placed}"),
    ("pick_place", "place_upside_down"): _parted("put the {object} {placed} upside down"),
    ("pick_place", "hold"): _held,
    ("pick_place", "rinse"): _parted("rinse the {object} under the faucet of the {target} and put it down"),
    ("pick_place", "cover"): _parted("put the lid on the {target}"),
    ("pick_place", "uncover"): _parted("take the lid off the {target}"),
}
