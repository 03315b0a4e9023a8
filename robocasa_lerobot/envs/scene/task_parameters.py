"""Draws what a task leaves open: knob, rack, slot, drawer or direction, and the words for it; how many of an
object there are, which model each of them is, and where it starts, by what was drawn before.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.envs.scene.spec import InsideOf, ObjectSpec, OnCounter, Placement
from robocasa_lerobot.envs.scene.words import numbered
from robocasa_lerobot.errors import UserError

_SIDES = {"left": -1.0, "front": -1.0, "middle": 0.0, "right": 1.0, "back": 1.0}
type _Position = float | str | None


@dataclass(frozen=True)
class Choices:
    """Values by name, as declarations use them in braces, and words by name, as instructions do."""

    values: dict[str, str] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)


def draw_choices(
    rng: np.random.Generator, task: SceneSpec, fixtures: Mapping[str, Fixture], roles: dict[str, str]
) -> Choices:
    """Draw every choice of a task, each option alike.

    Raises:
        PlacementError: the fixture has nothing to choose from.
    """
    drawn = Choices(dict(roles))
    for choice in task.choices:
        options = fixtures[roles[choice.of]].parts_to_choose(choice.name) if choice.of else choice.options
        if choice.without:
            options = {value: words for value, words in options.items() if not value.startswith(choice.without)}
        options = {value: words for value, words in options.items() if value.startswith(choice.beginning)}
        if not options:
            raise PlacementError(f"{roles[choice.of]} has no {choice.name} {choice.beginning} to choose".rstrip())
        value = list(options)[-1 if choice.last else int(rng.integers(len(options)))]
        drawn.values[choice.name] = value
        drawn.values.update({k: v for k, v in options[value].items() if k.startswith("_")})
        drawn.words[choice.name] = value
        drawn.words.update({k: v for k, v in options[value].items() if not k.startswith("_")})
    return drawn


def number_of(rng: np.random.Generator, wanted: ObjectSpec, choices: Mapping[str, str]) -> int:
    """How many there are; drawn, unless a choice says it.

    Raises:
        UserError: what a choice says is no number.
    """
    if isinstance(wanted.count, str):
        return _most(wanted, choices)
    return int(rng.integers(wanted.count[0], wanted.count[1] + 1))


def _most(wanted: ObjectSpec, choices: Mapping[str, str]) -> int:
    if isinstance(wanted.count, str):
        return int(_number(wanted.count, choices, f"count of {wanted.name}"))
    return wanted.count[1]


def name_of(wanted: ObjectSpec, index: int) -> str:
    """Its own name, or with its index where it may be one of several."""
    return wanted.name if wanted.count == (1, 1) else f"{wanted.name}_{index}"


def item_of(
    rng: np.random.Generator,
    wanted: ObjectSpec,
    index: int,
    split: str,
    items: Mapping[str, catalogue.Instance],
    choices: Mapping[str, str],
    later: Sequence[ObjectSpec] = (),
) -> catalogue.Instance:
    """Draw the model of one of the wanted objects.

    A category that an object declared later cannot do without is left to that one.

    Args:
        rng: generator that is advanced.
        wanted: the object.
        index: which of several.
        split: of object models.
        items: of the objects that the scene has already, by name.
        choices: what was drawn for the task's choices.
        later: the objects that are drawn after it.

    Raises:
        UserError: no category is left, or it is to be like an object, or the part of one, that is not there.
    """
    if wanted.part_of:
        return _part(wanted, items)
    asked = _asked(wanted, index, choices)
    like = _like(wanted, index, items)
    if like is not None and wanted.same_model:
        item = catalogue.scaled(catalogue.instance(like.category, like.index), asked.scale)
        return replace(item, upright=wanted.upright, stained=wanted.stained, face_down=wanted.face_down)
    groups = asked.groups if like is None else (like.category.name,)
    # An instruction names one object of the scene.
    used = frozenset(() if wanted.repeats or like is not None else (item.category.name for item in items.values()))
    if like is None and (kept := _kept_for(later, items, choices)) and _categories(asked) - used - kept:
        used |= kept
    drawn = catalogue.sample(
        rng,
        groups,
        split,
        exclude=used | frozenset(asked.exclude),
        properties=asked.properties,
        max_size=asked.max_size,
        object_scale=asked.scale,
        rotate_upright=wanted.upright,
    )
    if wanted.stained is None and not wanted.face_down:
        return drawn
    return replace(drawn, stained=wanted.stained, face_down=wanted.face_down)


class _Asked(NamedTuple):
    """What of the catalogue suits an object, whatever else is in the scene; arguments of `catalogue.pool`."""

    groups: tuple[str, ...]
    properties: tuple[str, ...]
    exclude: tuple[str, ...]
    max_size: tuple[float | None, float | None, float | None]
    scale: float | tuple[float, float, float]


def _asked(wanted: ObjectSpec, index: int, choices: Mapping[str, str]) -> _Asked:
    return _Asked(
        tuple(filled(group, choices) for group in wanted.groups),
        (*wanted.properties, *("graspable",) * wanted.graspable),
        wanted.exclude,
        (None, None, wanted.max_height) if wanted.max_size is None else wanted.max_size,
        _factors(wanted, index, choices),
    )


@functools.cache
def _categories(asked: _Asked) -> frozenset[str]:
    return frozenset(category.name for category in catalogue.pool(**asked._asdict()))


def _kept_for(
    later: Sequence[ObjectSpec], items: Mapping[str, catalogue.Instance], choices: Mapping[str, str]
) -> frozenset[str]:
    """The categories that are the last ones left for objects that are drawn later."""
    used = {item.category.name for item in items.values()}
    kept: set[str] = set()
    for wanted in later:
        if wanted.repeats or wanted.part_of or wanted.same_category_as not in ("", wanted.name):
            continue
        left = _categories(_asked(wanted, 0, choices)) - used
        if len(left) <= (1 if wanted.same_category_as else _most(wanted, choices)):
            kept |= left
    return frozenset(kept)


def start_of(
    rng: np.random.Generator, wanted: ObjectSpec, choices: Mapping[str, str]
) -> OnCounter | InsideOf | Placement:
    """Where it starts, with the choices filled in, and one taken of several names of regions ("{knob}|any")."""
    start = wanted.start
    if not isinstance(start, Placement):
        return start
    region = start.region
    if region.name or isinstance(region.level, str):
        names = region.name.split("|")
        name = filled(names[int(rng.integers(len(names)))], choices)
        level = filled(region.level, choices) if isinstance(region.level, str) else region.level
        region = replace(region, name="" if name == "any" else name, level=level)
    region = replace(region, ref=filled(region.ref, choices), loc=filled(region.loc, choices))
    across, along = start.pos
    other_way = start.other_rotation is not None and rng.integers(2)
    return replace(
        start,
        rotation=start.other_rotation if other_way and start.other_rotation else start.rotation,
        region=region,
        fixture=filled(start.fixture, choices),
        object=filled(start.object, choices),
        pos=(_position(across, wanted, choices), _position(along, wanted, choices)),
    )


def _like(wanted: ObjectSpec, index: int, items: Mapping[str, catalogue.Instance]) -> catalogue.Instance | None:
    """The object whose category is taken again; the first of several alike has none."""
    if not wanted.same_category_as:
        return None
    known = numbered(wanted.same_category_as, items)
    if known:
        return items[known[0]]
    if wanted.same_category_as == wanted.name and index == 0:
        return None
    raise UserError(
        f"{wanted.name} is to be like {wanted.same_category_as!r}, which is not there before it "
        f"({', '.join(items) or 'nothing is'}). Declare that first."
    )


def _part(wanted: ObjectSpec, items: Mapping[str, catalogue.Instance]) -> catalogue.Instance:
    """The part that belongs to an object that is there already."""
    whole = items.get(wanted.part_of)
    part = None if whole is None else catalogue.auxiliary(whole)
    if part is None or part.category.name not in wanted.groups:
        raise UserError(
            f"{wanted.name} is to be the {' or '.join(wanted.groups)} of {wanted.part_of!r}, which "
            + (f"is not there before it ({', '.join(items) or 'nothing is'})." if whole is None else "has none.")
            + " Declare before it an object of a category that comes with one."
        )
    return part


def _factors(wanted: ObjectSpec, index: int, choices: Mapping[str, str]) -> float | tuple[float, float, float]:
    scale = wanted.scale
    factors = _number(scale, choices, f"scale of {wanted.name}") if isinstance(scale, str) else scale
    if wanted.scale_step == 1.0 or index == 0:
        return factors
    step = wanted.scale_step**index
    x, y, z = (factors,) * 3 if isinstance(factors, int | float) else factors
    return x * step, y * step, z * step


def _position(where: _Position, wanted: ObjectSpec, choices: Mapping[str, str]) -> _Position:
    """A position along one axis; "{side}" is that of the word that was drawn, "-{side}" the opposite one."""
    if not isinstance(where, str) or "{" not in where:
        return where
    sign = -1.0 if where.startswith("-") else 1.0
    word = filled(where.removeprefix("-"), choices)
    return sign * (_SIDES[word] if word in _SIDES else _number(word, choices, f"position of {wanted.name}"))


def _number(text: str, choices: Mapping[str, str], what: str) -> float:
    value = filled(text, choices)
    try:
        return float(value)
    except ValueError:
        raise UserError(f"the {what} is {text!r}, which was drawn as {value!r}: a number is needed.") from None


def filled(text: str, choices: Mapping[str, str]) -> str:
    """A name of a declaration with what was drawn for its choices."""
    return text.format_map(choices) if "{" in text else text
