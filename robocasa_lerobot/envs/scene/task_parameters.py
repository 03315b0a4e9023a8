"""Draws what a task leaves open: which knob, rack, slot or drawer, which way; and the words for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import Fridge
from robocasa_lerobot.envs.kitchens.appliances.kinds.oven import Oven
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster import Toaster
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster_oven import ToasterOven
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.envs.scene.spec import Choice

type Options = dict[str, dict[str, str]]


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
        options = _options(choice, fixtures[roles[choice.of]]) if choice.of else choice.options
        if not options:
            raise PlacementError(f"{roles[choice.of]} has no {choice.name} to choose")
        value = list(options)[int(rng.integers(len(options)))]
        drawn.values[choice.name] = value
        drawn.values.update({k: v for k, v in options[value].items() if k.startswith("_")})
        drawn.words[choice.name] = value
        drawn.words.update({k: v for k, v in options[value].items() if not k.startswith("_")})
    return drawn


def _options(choice: Choice, fixture: Fixture) -> Options:
    for kind, options in _BY_KIND:
        if isinstance(fixture, kind):
            return options(choice.name, fixture)
    raise AssertionError(f"{fixture.name} has nothing to choose from")


def _burners(name: str, hob: Fixture) -> Options:
    assert isinstance(hob, Hob)
    return {location: {name: location.replace("_", " ")} for location in hob.burners}


def _oven_racks(name: str, oven: Fixture) -> Options:
    assert isinstance(oven, Oven)
    return {rack: {name: word} for rack, word in zip(oven.racks, _levels(len(oven.racks)), strict=True)}


def _toaster_oven_racks(name: str, oven: Fixture) -> Options:
    assert isinstance(oven, ToasterOven)
    words = _levels(len(oven.racks))
    return {rack: {name: f"{word} rack".strip()} for rack, word in zip(oven.racks, words, strict=True)}


def _slots(name: str, toaster: Fixture) -> Options:
    assert isinstance(toaster, Toaster)
    return {str(slot): {"_side": str(slot // 2)} for slot in range(2 * toaster.sides)}


def _drawers(name: str, fridge: Fixture) -> Options:
    assert isinstance(fridge, Fridge)
    return {drawer: {} for drawer in fridge.drawers}


def _levels(count: int) -> tuple[str, ...]:
    """Words for racks from below; a single one needs none."""
    return ("",) if count == 1 else ("bottom", "top") if count == 2 else ("bottom", "middle", "top")


_BY_KIND: tuple[tuple[type[Fixture], Callable[[str, Fixture], Options]], ...] = (
    (Hob, _burners),
    (Oven, _oven_racks),
    (ToasterOven, _toaster_oven_racks),
    (Toaster, _slots),
    (Fridge, _drawers),
)
