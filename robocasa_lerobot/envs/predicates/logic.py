"""Goals: named conditions on the state of a scene, joined by and, or, not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import mujoco

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene


class Goal(ABC):
    """Something that holds or does not hold in a state."""

    @abstractmethod
    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Whether it holds; every named term that it is made of is written to `terms`."""

    def bound(self, scene: Scene) -> Goal:
        """The same in a scene, without what depends on what was drawn."""
        return self


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

    def bound(self, scene: Scene) -> Goal:
        """Bind every part."""
        return AllOf(*(part.bound(scene) for part in self.parts))


class AnyOf(Goal):
    """At least one part holds."""

    def __init__(self, *parts: Goal) -> None:
        self.parts = parts

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate every part."""
        held = [part.evaluate(scene, data, terms) for part in self.parts]
        return any(held)

    def bound(self, scene: Scene) -> Goal:
        """Bind every part."""
        return AnyOf(*(part.bound(scene) for part in self.parts))


class Not(Goal):
    """The part does not hold; its own terms are reported as they are."""

    def __init__(self, part: Goal) -> None:
        self.part = part

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate the part."""
        return not self.part.evaluate(scene, data, terms)

    def bound(self, scene: Scene) -> Goal:
        """Bind the part."""
        return Not(self.part.bound(scene))


class When(Goal):
    """One of several goals, by a value that was drawn at reset (`scene.spec.Choice`)."""

    def __init__(self, choice: str, goals: Mapping[str, Goal]) -> None:
        self.choice, self.goals = choice, dict(goals)

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate the goal of the value that was drawn."""
        return self.bound(scene).evaluate(scene, data, terms)

    def bound(self, scene: Scene) -> Goal:
        """The goal of the value that was drawn."""
        return self.goals[scene.choices[self.choice]].bound(scene)


class ForEach(Goal):
    """A goal for every one of the objects of a name, as many as were drawn; each has terms of its own.

    Args:
        object: name in the declaration; where several were drawn, their names are `<object>_0`, `<object>_1`, ...
        make: the goal of the object of a name, which it should use in the names of its terms.
    """

    def __init__(self, object: str, make: Callable[[str], Goal]) -> None:
        self.object, self.make = object, make

    @property
    def pattern(self) -> Goal:
        """The goal of any of them, `<object>_i`; for readers without a scene."""
        return self.make(f"{self.object}_i")

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate the goal of every one."""
        return self.bound(scene).evaluate(scene, data, terms)

    def bound(self, scene: Scene) -> Goal:
        """All of the goals of those that the scene has."""
        goals = [self.make(name).bound(scene) for name in scene.named(self.object)]
        return goals[0] if len(goals) == 1 else AllOf(*goals)


def plain(name: str) -> str:
    """A name without the braces of choices, for the names of terms."""
    return name.replace("{", "").replace("}", "")
