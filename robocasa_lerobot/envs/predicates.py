"""The vocabulary of goals: named conditions on the state of a scene, joined by and / or.

Thresholds and formulas are those of robocasa 1.0.1 where its check is sound.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robocasa_lerobot.envs.scene.robot_names import GRIP_SITE

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

GRIPPER_FAR_M = 0.25


class Goal(ABC):
    """Something that holds or does not hold in a state."""

    @abstractmethod
    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Whether it holds; every named term that it is made of is written to `terms`."""


class Term(Goal):
    """A single named condition."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Key in `info["success_terms"]`."""

    @abstractmethod
    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Whether the condition holds."""

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate and note the result under the term's name."""
        terms[self.name] = self.holds(scene, data)
        return terms[self.name]


class AllOf(Goal):
    """Every part holds. All parts are evaluated, so that a failure names all that is missing."""

    def __init__(self, *parts: Goal) -> None:
        self.parts = parts

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate every part."""
        held = [part.evaluate(scene, data, terms) for part in self.parts]
        return all(held)


class AnyOf(Goal):
    """At least one part holds."""

    def __init__(self, *parts: Goal) -> None:
        self.parts = parts

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate every part."""
        held = [part.evaluate(scene, data, terms) for part in self.parts]
        return any(held)


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
        return scene.drawer(self.fixture).openness(data) >= self.at_least


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
        return scene.drawer(self.fixture).openness(data) <= self.at_most


@dataclass(frozen=True)
class ObjectInBasin(Term):
    """An object's centre is inside the basin of a sink."""

    object: str
    fixture: str

    @property
    def name(self) -> str:
        """E.g. `obj_in_sink`."""
        return f"{self.object}_in_{self.fixture}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Test the body's origin against the basin's region."""
        return scene.sink(self.fixture).basin.contains(data, data.body(self.object).xpos)


@dataclass(frozen=True)
class GripperFar(Term):
    """The grip site is farther than a distance (metres) from an object's origin."""

    object: str
    distance: float = GRIPPER_FAR_M

    @property
    def name(self) -> str:
        """E.g. `gripper_far_from_obj`."""
        return f"gripper_far_from_{self.object}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the distance with the threshold."""
        return float(np.linalg.norm(data.site(GRIP_SITE).xpos - data.body(self.object).xpos)) > self.distance
