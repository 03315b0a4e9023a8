"""Conditions on what was before: steps counted, and what has happened once or never.

`evaluate` only reads what is remembered. It is brought up to date once after each control step, by
`Scene.after_control_step`; the state at reset does not count. The numbers are positions of hidden joints of the scene
(`scene/memory.py`), so whatever carries joint positions carries them. Terms inside are not reported: the memory is.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.predicates.logic import Goal, Term, every_goal_in, plain
from robocasa_lerobot.errors import UserError

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.drawn import Drawn
    from robocasa_lerobot.envs.scene.scene import Scene

Array = NDArray[np.float64]


class WithMemory(Term):
    """A term that keeps numbers from step to step."""

    @property
    @abstractmethod
    def numbers(self) -> tuple[str, ...]:
        """Names of what it keeps."""

    @abstractmethod
    def after_step(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Its numbers after a control step; those before it are `kept`."""

    def begin(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Its numbers at the start of an episode."""
        return np.zeros(len(self.numbers))

    def kept(self, scene: Scene, data: mujoco.MjData) -> Array:
        """A copy of its numbers."""
        return scene.memory.read(data, self.name)

    def progress(self, scene: Scene, data: mujoco.MjData) -> float:
        """How far it is from the start (0) to holding (1), where it comes about little by little."""
        return float(self.holds(scene, data))


@dataclass(frozen=True)
class OfGoal(WithMemory):
    """What is remembered of another goal.

    Attributes:
        goal: the other goal.
        label: name of the term, if not what the goal is called.
    """

    goal: Goal
    label: str = field(default="", kw_only=True)

    @property
    def inner(self) -> tuple[Goal, ...]:
        """The other goal."""
        return (self.goal,)

    def bound(self, scene: Drawn) -> Goal:
        """Bind the other goal; the name stays, because the memory is kept under it."""
        goal = self.goal.bound(scene)
        return self if goal == self.goal else replace(self, goal=goal, label=self.name)


@dataclass(frozen=True)
class StepsWhile(OfGoal):
    """Another goal has held after a number of control steps (20 a second); from then on this holds for good.

    Attributes:
        n_steps: how often.
        consecutive: without a break; else in total.
    """

    n_steps: int
    consecutive: bool = False

    def __post_init__(self) -> None:
        if self.n_steps < 1:
            raise UserError(f"{self.name}: found n_steps {self.n_steps}, expected at least 1.")

    @property
    def name(self) -> str:
        """E.g. `obj_under_water_for_25_steps`."""
        return self.label or f"{plain(self.goal.name)}_for_{self.n_steps}_steps{'_on_end' * self.consecutive}"

    @property
    def numbers(self) -> tuple[str, ...]:
        """Steps so far; it stays when it is full."""
        return ("steps",)

    def after_step(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Count the step."""
        (steps,) = self.kept(scene, data)
        if steps < self.n_steps:
            held = self.goal.evaluate(scene, data, {})
            steps = steps + 1.0 if held else 0.0 if self.consecutive else steps
        return np.array([steps])

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the count with what is wanted."""
        return bool(self.kept(scene, data)[0] >= self.n_steps)

    def progress(self, scene: Scene, data: mujoco.MjData) -> float:
        """Share of the steps."""
        return float(self.kept(scene, data)[0]) / self.n_steps


@dataclass(frozen=True)
class Seen(OfGoal):
    """Remembers whether another goal has held after some control step."""

    @property
    def numbers(self) -> tuple[str, ...]:
        """Whether it has held: 0 or 1."""
        return ("seen",)

    def after_step(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Look, unless it has held already."""
        (seen,) = self.kept(scene, data)
        return np.array([float(seen > 0.5 or self.goal.evaluate(scene, data, {}))])

    def seen(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Whether it has held."""
        return bool(self.kept(scene, data)[0] > 0.5)


class Once(Seen):
    """Another goal has held after some control step."""

    @property
    def name(self) -> str:
        """E.g. `once_sink_water_on_and_sink_left`."""
        return self.label or f"once_{plain(self.goal.name)}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Whether it has held."""
        return self.seen(scene, data)


class Never(Seen):
    """Another goal has held after no control step; what has happened cannot be made good in the episode."""

    @property
    def name(self) -> str:
        """E.g. `never_gripper_touches_obj`."""
        return self.label or f"never_{plain(self.goal.name)}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Whether it has not held."""
        return not self.seen(scene, data)


def parts_with_memory(goals: Iterable[Goal]) -> tuple[WithMemory, ...]:
    """What of some goals has memory, each once, the inner before the outer that reads it.

    Raises:
        UserError: two different ones have one name.
    """
    found: dict[str, WithMemory] = {}
    for goal in goals:
        for part in every_goal_in(goal):
            if not isinstance(part, WithMemory):
                continue
            if found.setdefault(part.name, part) != part:
                raise UserError(
                    f"two terms with memory are called `{part.name}`: {found[part.name]} and {part}. "
                    "Give one of them a `label`, or make them equal."
                )
    return tuple(found.values())
