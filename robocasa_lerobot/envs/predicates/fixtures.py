"""Conditions on fixtures: doors, drawers, racks, knobs, levers, and states such as "on"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import CLOSED_UP_TO, OPEN_FROM, Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.predicates.logic import Term, plain
from robocasa_lerobot.envs.scene.initial_states import initial_share

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene


@dataclass(frozen=True)
class DrawerOpen(Term):
    """A drawer is out by at least a share of its full travel (0.55 of its depth)."""

    fixture: str
    at_least: float = 0.95

    @property
    def name(self) -> str:
        """E.g. `drawer_open`."""
        return f"{self.fixture}_open"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the openness with the threshold."""
        return scene.fixture(self.fixture, Drawer).openness(data) >= self.at_least


@dataclass(frozen=True)
class DrawerClosed(Term):
    """A drawer is out by at most a share of its full travel (0.55 of its depth)."""

    fixture: str
    at_most: float = 0.05

    @property
    def name(self) -> str:
        """E.g. `drawer_closed`."""
        return f"{self.fixture}_closed"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the openness with the threshold."""
        return scene.fixture(self.fixture, Drawer).openness(data) <= self.at_most


@dataclass(frozen=True)
class DoorsOpen(Term):
    """Every door of a fixture is open by at least a share of its range.

    It holds for a fixture without doors, such as an open cabinet.

    Attributes:
        fixture: role.
        at_least: share.
        part: start of the doors' names, such as the compartment "freezer"; all if empty. May name a choice in braces.
    """

    fixture: str
    at_least: float = OPEN_FROM
    part: str = ""

    @property
    def name(self) -> str:
        """E.g. `fridge_open`, `fridge_freezer_open`."""
        return f"{self.fixture}_{plain(self.part)}_open" if self.part else f"{self.fixture}_open"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare each door with the threshold."""
        shares = scene.fixture(self.fixture).door_shares(data, scene.fill(self.part))
        return all(share >= self.at_least for share in shares)


@dataclass(frozen=True)
class DoorsClosed(Term):
    """Every door of a fixture is open by at most a share of its range.

    It holds for a fixture without doors, such as an open cabinet.

    Attributes:
        fixture: role.
        at_most: share.
        part: start of the doors' names, such as the compartment "freezer"; all if empty. May name a choice in braces.
    """

    fixture: str
    at_most: float = CLOSED_UP_TO
    part: str = ""

    @property
    def name(self) -> str:
        """E.g. `fridge_closed`, `fridge_freezer_closed`."""
        return f"{self.fixture}_{plain(self.part)}_closed" if self.part else f"{self.fixture}_closed"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare each door with the threshold."""
        shares = scene.fixture(self.fixture).door_shares(data, scene.fill(self.part))
        return all(share <= self.at_most for share in shares)


@dataclass(frozen=True)
class PartWithin(Term):
    """A moving part of an appliance is within bounds, as shares of its range.

    Attributes:
        fixture: role.
        part: name; may name a choice in braces.
        low, high: bounds, both allowed.
        label: for the term's name, e.g. "out".
    """

    fixture: str
    part: str
    low: float = -np.inf
    high: float = np.inf
    label: str = "set"

    @property
    def name(self) -> str:
        """E.g. `rack_out`."""
        return f"{plain(self.part)}_{self.label}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the share with the bounds."""
        share = scene.fixture(self.fixture, Appliance).share(data, scene.fill(self.part))
        return self.low <= share <= self.high


@dataclass(frozen=True)
class PartTurned(Term):
    """A moving part has gone from where it was at reset, by at least a share of its range; upwards if positive."""

    fixture: str
    part: str
    by: float
    label: str = "turned"

    @property
    def name(self) -> str:
        """E.g. `temperature_raised`."""
        return f"{self.part}_{self.label}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the change with the wanted one."""
        change = scene.fixture(self.fixture, Appliance).share(data, self.part) - initial_share(
            scene, self.fixture, self.part
        )
        return change >= self.by if self.by > 0 else change <= self.by


@dataclass(frozen=True)
class StateIs(Term):
    """An entry of an appliance's `state` has a truth value, such as "on" or "left".

    Attributes:
        fixture: role.
        key: of the state; may name a choice in braces, as in "{knob}_on".
        value: wanted.
    """

    fixture: str
    key: str
    value: bool = True

    @property
    def name(self) -> str:
        """E.g. `microwave_on`, `microwave_not_on`."""
        key = plain(self.key)
        return f"{self.fixture}_{key}" if self.value else f"{self.fixture}_not_{key}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Read the state."""
        return bool(scene.fixture(self.fixture, Appliance).state(data)[scene.fill(self.key)]) == self.value


@dataclass(frozen=True)
class BurnerLevel(Term):
    """The knob of a burner asks for "off", "low" or "high"."""

    fixture: str
    location: str
    level: str

    @property
    def name(self) -> str:
        """E.g. `knob_low`."""
        return f"{plain(self.location)}_{self.level}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Read the knob."""
        return scene.fixture(self.fixture, Hob).burner_level(data, scene.fill(self.location)) == self.level
