"""How fixtures start: doors, knobs, water, switches. Drawn from the scene's seed, written into the first state.

Each is a record of a task declaration. `draw` takes the random numbers while the scene is made, so that placement can
ask where a pulled-out rack is; `apply` writes positions before the scene settles.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

type Bounds = tuple[float, float]


class Initial(ABC):
    """Part of the first state of a fixture.

    Attributes:
        fixture: role.
    """

    fixture: str

    def draw(self, rng: np.random.Generator, choices: Mapping[str, str]) -> float:
        """A number that `apply` gets back; by default a share in [0, 1)."""
        return float(rng.uniform())

    @abstractmethod
    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Write it to the state."""


@dataclass(frozen=True)
class PartAt(Initial):
    """A moving part of an appliance is at a share of its range.

    Attributes:
        fixture: role.
        part: name; may name a choice in braces.
        at: bounds, or by the value of a choice its bounds.
        choice: name of that choice.
    """

    fixture: str
    part: str
    at: Bounds | Mapping[str, Bounds]
    choice: str = ""

    def draw(self, rng: np.random.Generator, choices: Mapping[str, str]) -> float:
        """The share."""
        low, high = self.at[choices[self.choice]] if isinstance(self.at, Mapping) else self.at
        return float(rng.uniform(low, high))

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Write the share."""
        scene.fixture(self.fixture, Appliance).set_share(data, scene.fill(self.part), drawn)


@dataclass(frozen=True)
class BurnerAt(Initial):
    """The knob of a burner asks for "off", "on", "low" or "high"."""

    fixture: str
    location: str
    level: str

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Turn the knob to a share of that level's range."""
        scene.fixture(self.fixture, Hob).set_burner(data, scene.fill(self.location), self.level, drawn)


@dataclass(frozen=True)
class Water(Initial):
    """The faucet of a sink runs, or not; `on` None is either, as the draw falls."""

    fixture: str
    on: bool | None

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Turn the handle."""
        on, draw = (drawn < 0.5, (2 * drawn) % 1.0) if self.on is None else (self.on, drawn)
        scene.fixture(self.fixture, Sink).set_water(data, on, draw)


@dataclass(frozen=True)
class SwitchedOn(Initial):
    """An appliance with a button is on."""

    fixture: str

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Switch it on."""
        scene.fixture(self.fixture, Appliance).set_on(data, True)


@dataclass(frozen=True)
class LidAside(Initial):
    """The lid of a blender lies on the counter beside it, or is nowhere near if `gone`."""

    fixture: str
    gone: bool = False

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Lay it down where the scene found room for it."""
        scene.lay_lid(self.fixture, data, drawn, gone=self.gone)


def initial_share(scene: Scene, role: str, part: str) -> float:
    """Where a part of an appliance was at reset, as a share of its range."""
    return next(
        drawn
        for entry, drawn in scene.initial
        if isinstance(entry, PartAt) and (entry.fixture, entry.part) == (role, part)
    )
