"""The words that a task is declared in: fixtures wanted, objects, robot start, initial state, goal, stages.

A task is data. The scene builder reads what is wanted, the env reads the goal, the demonstrator reads the stages.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from robocasa_lerobot.benchmark.tasks import TaskFacts, facts_of
from robocasa_lerobot.envs.initial import Initial
from robocasa_lerobot.envs.predicates.logic import Goal
from robocasa_lerobot.envs.scene.wanted import Choice, FixtureWanted, InitialOpenness, ObjectWanted, RobotStart

type InitialState = InitialOpenness | Initial


@dataclass(frozen=True)
class Stage:
    """One use of a foundational skill; the demonstrator carries the stages out in order.

    Attributes:
        skill: one of the eight: "drawers", "pick_place", ...
        verb: what is done, e.g. "open".
        target: role of the fixture.
        object: name of the object that is handled, if any.
        part: of the fixture, if any; may name a choice in braces.
    """

    skill: str
    verb: str
    target: str
    object: str = ""
    part: str = ""


@dataclass(frozen=True)
class Task:
    """A task declaration; what the benchmark says of the task besides is in `facts`.

    Attributes:
        name: id, as in RoboCasa365.
        summary: when it counts as solved, in a sentence.
        fixtures, objects, robot_start, initial: the scene.
        choices: what is drawn at reset.
        goal: what must hold; its terms are reported one by one.
        instruction: template; fields are "{side}" and names of objects.
        paraphrases: other wordings, kept apart as novel language.
        stages: the plan.
        needs: names of `scene.kitchens.EXCLUDED`, of what a layout must have: the others are left out, always.
        exclude_styles: ids of styles that do not suit it.
    """

    name: str
    summary: str = field(compare=False)
    fixtures: tuple[FixtureWanted, ...]
    robot_start: RobotStart
    goal: Goal
    instruction: str
    stages: tuple[Stage, ...]
    objects: tuple[ObjectWanted, ...] = ()
    initial: tuple[InitialState, ...] = ()
    choices: tuple[Choice, ...] = ()
    paraphrases: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    exclude_styles: tuple[int, ...] = ()

    @property
    def facts(self) -> TaskFacts:
        """Kind, sets, horizon and what else is published of it."""
        return facts_of(self.name)

    @property
    def horizon(self) -> int:
        """Control steps at 20 Hz until an episode counts as failed."""
        assert self.facts.horizon is not None, f"{self.name}: no horizon is published"
        return self.facts.horizon
