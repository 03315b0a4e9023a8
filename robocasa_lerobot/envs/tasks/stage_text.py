"""What a stage is called in an episode: a short imperative sentence, with the words of the instruction."""

from __future__ import annotations

from collections.abc import Callable

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import HingeCabinet
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.words import said
from robocasa_lerobot.envs.tasks.task import Stage

_DEEP_M = 0.04  # what is deeper is put into, not on
# Parts of appliances that have another name in speech; others are called by their name without underscores.
_PARTS = {
    "knob_temp": "temperature knob",
    "knob_time": "timer knob",
    "handle_temp": "handle",
    "rack": "rack",
    "receptacle": "dispenser",
}
_WAYS = {"increase": "up", "decrease": "down"}


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
    """Which way; a drawn one by the word of its choice."""
    way = stage.to
    for name, word in scene.words.items():
        way = way.replace(f"{{{name}}}", word)
    return _WAYS.get(scene.fill(way), scene.fill(way))


def _doors(stage: Stage, scene: Scene) -> str:
    """The doors of a fixture, or the one that is named."""
    target = _target(stage, scene)
    if stage.part:
        return f"{_part(stage, scene)} of the {target}"
    fixture = scene.fixture(stage.target)
    doors = fixture.doors if isinstance(fixture, HingeCabinet | Appliance) else 1
    number = doors if isinstance(doors, int) else len(doors)
    return f"{'doors' if number > 1 else 'door'} of the {target}"


def _holding(stage: Stage, scene: Scene) -> str:
    """Into or onto the target: by the depth of what it holds things in."""
    placed = scene.objects.get(stage.target)
    interior = None if placed is None else placed.item.interior
    deep = interior is not None and 2 * interior.half[2] > _DEEP_M
    return f"{'into' if deep else 'on'} the {_target(stage, scene)}"


def _inside(stage: Stage, scene: Scene) -> str:
    """Into the target, or onto the part of it that is named."""
    target = _target(stage, scene)
    if not stage.part:
        return f"into the {target}"
    part = _part(stage, scene)
    if part.endswith("shelf"):
        return f"on a shelf of the {target}"
    return f"{'into' if part.endswith('drawer') else 'on'} the {part} of the {target}"


def _plainly(stage: Stage, scene: Scene) -> str:
    """For verbs that have no wording of their own."""
    verb = stage.verb.replace("_", " ")
    if stage.object:
        return f"{verb} the {_object(stage, scene)}"
    part = f"{_part(stage, scene)} of the " if stage.part else ""
    return f"{verb} the {part}{_target(stage, scene)}"


type _Wording = Callable[[Stage, Scene], str]


def _parted(pattern: str) -> _Wording:
    """With {part}, {target}, {object}, {to}, {doors}, {holding} and {inside}, each made where it is named."""
    makers = {
        "part": _part, "target": _target, "object": _object, "to": _to, "doors": _doors, "holding": _holding,
        "inside": _inside,
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
    ("navigation", "drive"): _parted("go to the {target}"),
    ("buttons", "press"): _parted("press the {part} of the {target}"),
    ("levers", "press"): _parted("press the {part} of the {target}"),
    ("knobs", "on"): _parted("turn on the {part} of the {target}"),
    ("knobs", "off"): _parted("turn off the {part} of the {target}"),
    ("knobs", "low"): _parted("turn the {part} of the {target} down to low"),
    ("knobs", "raise"): _parted("turn up the {part} of the {target}"),
    ("knobs", "turn"): _parted("turn the {part} of the {target} {to}"),
    ("levers", "on"): _parted("turn on the faucet of the {target}"),
    ("levers", "off"): _parted("turn off the faucet of the {target}"),
    ("levers", "turn"): _turned,
    ("pick_place", "pick"): _parted("pick up the {object}"),
    ("pick_place", "place"): _parted("put the {object} into the {target}"),
    ("pick_place", "cover"): _parted("put the lid on the {target}"),
    ("pick_place", "uncover"): _parted("take the lid off the {target}"),
    ("pick_place", "drop_into"): _parted("drop the {object} into the {target}"),
    ("pick_place", "drop_into_jug"): _parted("drop the {object} into the {target}"),
    ("pick_place", "place_at_site"): _parted("put the {object} under the {part} of the {target}"),
    ("pick_place", "take_from_spout"): _parted("take the {object} from under the dispenser to the {target}"),
    ("pick_place", "take_out_of_drawer"): _parted("take the {object} out of the drawer to the {target}"),
    **{
        ("pick_place", verb): _parted("put the {object} {holding}")
        for verb in ("place_on", "place_on_from_pan", "place_on_reaching_in", "place_on_counter")
    },
    **{("pick_place", verb): _parted("put the {object} {inside}") for verb in ("place_inside", "place_inside_fridge")},
}
