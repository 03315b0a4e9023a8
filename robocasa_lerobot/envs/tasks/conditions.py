"""When a stage of a task is done: its own condition, or what its verb asks for, in the predicates of goals."""

from __future__ import annotations

from collections.abc import Callable

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    DoorsOpen,
    DrawerClosed,
    DrawerOpen,
    Goal,
    GripperFar,
    GripperFarFromPart,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    PartWithin,
    StandsBefore,
    StateIs,
)
from robocasa_lerobot.envs.tasks.task import BoundTask, Stage
from robocasa_lerobot.errors import UserError

OUT_FROM, IN_UP_TO = 0.95, 0.05  # of a rack's or a drawer's range


def _let_go(stage: Stage, goal: Goal) -> Goal:
    return AllOf(goal, GripperFar(stage.object))


def _on(stage: Stage) -> Goal:
    return _let_go(stage, ObjectOn(stage.object, stage.target))


def _inside(stage: Stage) -> Goal:
    return _let_go(stage, ObjectInside(stage.object, stage.target, region=stage.part))


def _on_counter(stage: Stage) -> Goal:
    return _let_go(stage, ObjectTouches(stage.object, stage.target))


def _opened(stage: Stage) -> Goal:
    return DoorsOpen(stage.target)


def _closed(stage: Stage) -> Goal:
    return DoorsClosed(stage.target)


_BY_VERB: dict[tuple[str, str], Callable[[Stage], Goal]] = {
    ("doors", "open"): _opened,
    **dict.fromkeys(
        (("doors", "close"), ("doors", "close_large"), ("doors", "lift_shut"), ("doors", "lift_low")), _closed
    ),
    ("drawers", "open"): lambda stage: DrawerOpen(stage.target, at_least=OUT_FROM),
    ("drawers", "close"): lambda stage: DrawerClosed(stage.target, at_most=IN_UP_TO),
    ("racks", "pull"): lambda stage: PartWithin(stage.target, stage.part, low=OUT_FROM, label="out"),
    ("racks", "push"): lambda stage: PartWithin(stage.target, stage.part, high=IN_UP_TO, label="in"),
    ("navigation", "drive"): lambda stage: StandsBefore(stage.target),
    ("levers", "on"): lambda stage: StateIs(stage.target, "water_on"),
    ("levers", "off"): lambda stage: StateIs(stage.target, "water_on", value=False),
    ("pick_place", "place"): lambda stage: _let_go(stage, ObjectInBasin(stage.object, stage.target)),
    **{("pick_place", verb): _on for verb in ("place_on", "place_on_from_pan", "place_on_reaching_in", "drop_into")},
    **{("pick_place", verb): _inside for verb in ("place_inside", "place_inside_fridge", "drop_into_jug")},
    **{("pick_place", verb): _on_counter for verb in ("place_on_counter", "take_out_of_drawer", "take_from_spout")},
}


def stage_condition(task: BoundTask, stage: Stage) -> Goal:
    """What holds when a stage is done: its `until`; the goal of a task of one stage; else its verb's own condition.

    Raises:
        UserError: the verb has none, since what it does depends on the task.
    """
    if stage.until is not None:
        return stage.until
    if task.stages == (stage,):
        return task.goal
    key = (stage.skill, stage.verb)
    if key not in _BY_VERB:
        raise UserError(
            f"{task.name}: the stage `{' '.join(key)}` needs a condition of its own: what a {stage.verb} of "
            f"{stage.skill} comes to is not the same everywhere. Give the stage `until=...`."
        )
    return _BY_VERB[key](stage)


def without_gripper(goal: Goal) -> Goal:
    """What of a stage's condition must still hold when the hand is busy with the next one."""
    if isinstance(goal, AllOf):
        return AllOf(*(part for part in goal.parts if not isinstance(part, GripperFar | GripperFarFromPart)))
    return goal
