"""Draws what a task leaves open: which knob, rack, slot or drawer, which way; and the words for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec


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
        if not options:
            raise PlacementError(f"{roles[choice.of]} has no {choice.name} to choose")
        value = list(options)[int(rng.integers(len(options)))]
        drawn.values[choice.name] = value
        drawn.values.update({k: v for k, v in options[value].items() if k.startswith("_")})
        drawn.words[choice.name] = value
        drawn.words.update({k: v for k, v in options[value].items() if not k.startswith("_")})
    return drawn
