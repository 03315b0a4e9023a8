"""The words that a task is declared in: its scene, goal and stages.

A task is data. The scene builder reads the scene, the env reads the goal, the demonstrator reads the stages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

from robocasa_lerobot.benchmark.tasks import TaskFacts, facts_of
from robocasa_lerobot.envs.predicates.logic import Goal, terms_by_name
from robocasa_lerobot.envs.predicates.memory import WithMemory, parts_with_memory
from robocasa_lerobot.envs.scene.drawn import Drawn
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.errors import UserError


@dataclass(frozen=True)
class Stage:
    """One use of a foundational skill; the demonstrator carries the stages out in order.

    Attributes:
        skill: one of the eight: "drawers", "pick_place", ...
        verb: e.g. "open".
        target: role of the fixture.
        object: name of the object that is handled, if any; it and the target may name a choice in braces.
        part: of the fixture, if any: a knob, a rack, the doors of its "freezer", a shelf by its level, as
            "fridge_shelf:highest"; may name a choice in braces.
        to: direction, for verbs that have several: "left", "out", "increase"; may name a choice in braces.
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


@dataclass(frozen=True)
class EachStage:
    """Stages for every one of the objects of a name, as many as were drawn: all of the first, then of the second, ...

    Attributes:
        object: name in the declaration.
        make: the stages of the object of a name.
    """

    object: str
    make: Callable[[str], tuple[Stage, ...]]


@dataclass(frozen=True)
class StagesWhen:
    """Stages by a value that was drawn at reset (`scene.spec.Choice`); none for values that are not named."""

    choice: str
    stages: Mapping[str, tuple[Stage | EachStage, ...]]


type StagePlan = tuple[Stage | EachStage | StagesWhen, ...]


@dataclass(frozen=True, kw_only=True)
class Task(SceneSpec):
    """A task declaration; what the benchmark says of the task besides is in `facts`.

    Attributes:
        summary: when it counts as solved, in a sentence.
        goal: what must hold; its terms are reported one by one. A function of the scene where no word of goals says it.
        stages: the plan. A function of the scene where neither `EachStage` nor `StagesWhen` says it.

    Raises:
        UserError: two terms of the goal, or of a stage's condition, have one name.
    """

    summary: str = field(compare=False)
    goal: Goal | Callable[[Drawn], Goal]
    stages: StagePlan | Callable[[Drawn], tuple[Stage, ...]]

    def __post_init__(self) -> None:
        try:
            for goal in self._goals:
                terms_by_name(goal)
            parts_with_memory(self._goals)
        except UserError as error:
            raise UserError(f"task {self.name}: {error}") from error

    def remembering(self, scene: Drawn) -> tuple[WithMemory, ...]:
        """What of the goal and of the stages' conditions has memory, the inner first."""
        return parts_with_memory(self.bound(scene)._goals)

    @property
    def _goals(self) -> tuple[Goal, ...]:
        """The goal and the stages' conditions, as far as they are known before a scene is drawn."""
        stages = () if callable(self.stages) else possible_stages(self.stages)
        goals = (self.goal, *(stage.until for stage in stages))
        return tuple(goal for goal in goals if isinstance(goal, Goal))

    @property
    def facts(self) -> TaskFacts:
        """Kind, sets, horizon and what else is published of it."""
        return facts_of(self.name)

    @property
    def horizon(self) -> int:
        """Control steps at 20 Hz until an episode counts as failed."""
        steps = self.facts.horizon or self.facts.own_horizon
        assert steps is not None, f"{self.name}: no horizon is published, and `own_horizon` is not set"
        return steps

    def bound(self, scene: Drawn) -> BoundTask:
        """The task as it is in a scene.

        Raises:
            UserError: a scene without stages.
        """
        stages = self.stages(scene) if callable(self.stages) else _resolved(self.stages, scene)
        if not stages:
            raise UserError(
                f"{self.name}: no stage: what was drawn ({scene.choices}) leaves nothing to do. Give every outcome a "
                "stage."
            )
        own = {entry.name: getattr(self, entry.name) for entry in fields(Task)}
        goal = self.goal if isinstance(self.goal, Goal) else self.goal(scene)
        return BoundTask(**own | {"goal": goal.bound(scene), "stages": tuple(_named(stage, scene) for stage in stages)})


@dataclass(frozen=True, kw_only=True)
class BoundTask(Task):
    """A task in a scene: its goal and its stages are those of what was drawn."""

    goal: Goal
    stages: tuple[Stage, ...]


def _named(stage: Stage, scene: Drawn) -> Stage:
    """With the object and target that a choice names, as in `object="{tool}"`, and its condition bound.

    Names of fixtures' parts stay.
    """
    choices = scene.choices.keys() - scene.roles

    def drawn(name: str) -> str:
        return scene.fill(name) if any(f"{{{choice}}}" in name for choice in choices) else name

    until = None if stage.until is None else stage.until.bound(scene)
    return replace(stage, object=drawn(stage.object), target=drawn(stage.target), until=until)


def _resolved(plan: StagePlan, scene: Drawn) -> tuple[Stage, ...]:
    found: list[Stage] = []
    for entry in plan:
        if isinstance(entry, Stage):
            found.append(entry)
        elif isinstance(entry, EachStage):
            found += [stage for name in scene.named(entry.object) for stage in entry.make(name)]
        else:
            found += _resolved(entry.stages.get(scene.choices[entry.choice], ()), scene)
    return tuple(found)


def possible_stages(plan: StagePlan) -> tuple[Stage, ...]:
    """Every stage that a plan may come to, those of several objects once, as `<object>_i`."""
    found: list[Stage] = []
    for entry in plan:
        if isinstance(entry, Stage):
            found.append(entry)
        elif isinstance(entry, EachStage):
            found += entry.make(f"{entry.object}_i")
        else:
            found += [stage for stages in entry.stages.values() for stage in possible_stages(stages)]
    return tuple(found)
