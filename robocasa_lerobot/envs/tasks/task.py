"""The words that a task is declared in: its scene, goal and stages.

A task is data. The scene builder reads what is wanted, the env reads the goal, the demonstrator reads the stages.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from robocasa_lerobot.benchmark.tasks import TaskFacts, facts_of
from robocasa_lerobot.envs.predicates.logic import Goal
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec


@dataclass(frozen=True)
class Stage:
    """One use of a foundational skill; the demonstrator carries the stages out in order.

    Attributes:
        skill: one of the eight: "drawers", "pick_place", ...
        verb: what is done, e.g. "open".
        target: role of the fixture.
        object: name of the object that is handled, if any.
        part: of the fixture, if any; may name a choice in braces.
        to: which way, for verbs that go several: "left", "out", "increase"; may name a choice in braces.
        until: when it is done, where that is not what its verb always asks for (`tasks.conditions`).
        text: what it is called, where not as its verb always is (`tasks.stage_text`); fields as in instructions.
    """

    skill: str
    verb: str
    target: str
    object: str = ""
    part: str = ""
    to: str = ""
    until: Goal | None = None
    text: str = ""


@dataclass(frozen=True, kw_only=True)
class Task(SceneSpec):
    """A task declaration; what the benchmark says of the task besides is in `facts`.

    Attributes:
        summary: when it counts as solved, in a sentence.
        goal: what must hold; its terms are reported one by one.
        stages: the plan.
    """

    summary: str = field(compare=False)
    goal: Goal
    stages: tuple[Stage, ...]

    @property
    def facts(self) -> TaskFacts:
        """Kind, sets, horizon and what else is published of it."""
        return facts_of(self.name)

    @property
    def horizon(self) -> int:
        """Control steps at 20 Hz until an episode counts as failed."""
        assert self.facts.horizon is not None, f"{self.name}: no horizon is published"
        return self.facts.horizon
