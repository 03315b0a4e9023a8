"""The words that a task is declared in: its scene, goal and stages.

A task is data. The scene builder reads what is wanted, the env reads the goal, the demonstrator reads the stages.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from robocasa_lerobot.benchmark.tasks import TaskFacts, facts_of
from robocasa_lerobot.envs.predicates.logic import Goal, terms_by_name
from robocasa_lerobot.envs.predicates.memory import WithMemory, parts_with_memory
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.errors import UserError


@dataclass(frozen=True)
class Stage:
    """One use of a foundational skill; the demonstrator carries the stages out in order.

    Attributes:
        skill: one of the eight: "drawers", "pick_place", ...
        verb: what is done, e.g. "open".
        target: role of the fixture.
        object: name of the object that is handled, if any.
        part: of the fixture, if any: a knob, a rack, the doors of its "freezer", a shelf by its level, as
            "fridge_shelf:highest"; may name a choice in braces.
        to: which way, for verbs that go several: "left", "out", "increase"; may name a choice in braces.
        until: when it is done, where that is not what its verb always asks for (`tasks.conditions`).
    """

    skill: str
    verb: str
    target: str
    object: str = ""
    part: str = ""
    to: str = ""
    until: Goal | None = None


@dataclass(frozen=True, kw_only=True)
class Task(SceneSpec):
    """A task declaration; what the benchmark says of the task besides is in `facts`.

    Attributes:
        summary: when it counts as solved, in a sentence.
        goal: what must hold; its terms are reported one by one.
        stages: the plan.

    Raises:
        UserError: two terms of the goal, or of a stage's condition, have one name.
    """

    summary: str = field(compare=False)
    goal: Goal
    stages: tuple[Stage, ...]

    def __post_init__(self) -> None:
        try:
            for goal in self._goals:
                terms_by_name(goal)
            parts_with_memory(self._goals)
        except UserError as error:
            raise UserError(f"task {self.name}: {error}") from error

    @property
    def remembering(self) -> tuple[WithMemory, ...]:
        """What of the goal and of the stages' conditions has memory, the inner first."""
        return parts_with_memory(self._goals)

    @property
    def _goals(self) -> tuple[Goal, ...]:
        return (self.goal, *(stage.until for stage in self.stages if stage.until is not None))

    @property
    def facts(self) -> TaskFacts:
        """Kind, sets, horizon and what else is published of it."""
        return facts_of(self.name)

    @property
    def horizon(self) -> int:
        """Control steps at 20 Hz until an episode counts as failed."""
        assert self.facts.horizon is not None, f"{self.name}: no horizon is published"
        return self.facts.horizon
