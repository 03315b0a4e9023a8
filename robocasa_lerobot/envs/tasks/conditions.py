"""When a stage of a task is done: its own condition, or what its verb asks for, in the predicates of goals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    DoorsOpen,
    DrawerClosed,
    DrawerOpen,
    Goal,
    Grasped,
    GripperFar,
    GripperFarFromPart,
    MovedSince,
    Never,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTilt,
    ObjectTouches,
    OnBurner,
    OnShelf,
    PartWithin,
    StandsBefore,
    StandsNear,
    StateIs,
    inside,
)
from robocasa_lerobot.envs.tasks.task import BoundTask, Stage
from robocasa_lerobot.errors import UserError

OUT_FROM, IN_UP_TO = 0.95, 0.05  # of a rack's or a drawer's range
IN_RANGE = ("interior", "cavity")  # regions of stoves that are below their burners
KNOB = "knob_"
UPSIDE_DOWN_RAD = float(np.deg2rad(170.0))


def _placed(task: BoundTask, stage: Stage) -> AllOf:
    """Where the object belongs, by what the target is, and let go."""
    kind = next((fixture.kind for fixture in task.fixtures if fixture.role == stage.target), None)
    if kind is None:
        where: Goal = ObjectOn(stage.object, stage.target)
    elif "counter" in kind or kind in ("island",):
        where = ObjectTouches(stage.object, stage.target)
    elif kind.startswith("sink"):
        where = ObjectInBasin(stage.object, stage.target)
    elif kind.startswith("stove") and stage.part not in IN_RANGE:
        where = OnBurner(stage.object, stage.target, burner=stage.part)
    else:
        where = _as_exact(task.goal, inside(stage.object, stage.target, stage.part))
    return AllOf(where, GripperFar(stage.object))


def _upside_down(task: BoundTask, stage: Stage) -> Goal:
    """Where the object belongs, let go, and on its head."""
    over = ObjectTilt(stage.object, low=UPSIDE_DOWN_RAD, label="upside_down")
    return AllOf(*_placed(task, stage).parts, over)


def _as_exact(goal: Goal, where: ObjectInside) -> ObjectInside:
    """With no more margin than the goal gives to the same object there: else the stage would be done before it is."""
    if isinstance(where, OnShelf):
        return where
    parts = goal.parts if isinstance(goal, AllOf) else (goal,)
    margins = [part.margin for part in parts if isinstance(part, ObjectInside) and part.name == where.name]
    return replace(where, margin=min([where.margin, *margins]))


def _driven(task: BoundTask, stage: Stage) -> Goal:
    """Before a fixture or an object, and with the carried object, if any, in the hand."""
    roles = {fixture.role for fixture in task.fixtures}
    there = StandsBefore(stage.target, free=True) if stage.target in roles else StandsNear(stage.target)
    return AllOf(there, Grasped(stage.object)) if stage.object else there


def _burner(on: bool) -> Callable[[BoundTask, Stage], Goal]:
    """The burner of a knob, or that of the object that a stage names, is on or off; the object let go."""

    def condition(task: BoundTask, stage: Stage) -> Goal:
        if stage.object:
            return AllOf(OnBurner(stage.object, stage.target, lit=on), GripperFar(stage.object))
        if not stage.part.startswith(KNOB):
            raise _needs_own(task, stage)
        return StateIs(stage.target, f"{stage.part.removeprefix(KNOB)}_on", value=on)

    return condition


def _opened(task: BoundTask, stage: Stage) -> Goal:
    return DoorsOpen(stage.target, part=stage.part)


def _closed(task: BoundTask, stage: Stage) -> Goal:
    return DoorsClosed(stage.target, part=stage.part)


_BY_VERB: dict[tuple[str, str], Callable[[BoundTask, Stage], Goal]] = {
    ("doors", "open"): _opened,
    **dict.fromkeys(
        (("doors", "close"), ("doors", "close_large"), ("doors", "lift_shut"), ("doors", "lift_low")), _closed
    ),
    ("drawers", "open"): lambda task, stage: DrawerOpen(stage.target, at_least=OUT_FROM),
    ("drawers", "close"): lambda task, stage: DrawerClosed(stage.target, at_most=IN_UP_TO),
    ("racks", "pull"): lambda task, stage: PartWithin(stage.target, stage.part, low=OUT_FROM, label="out"),
    ("racks", "push"): lambda task, stage: PartWithin(stage.target, stage.part, high=IN_UP_TO, label="in"),
    ("knobs", "on"): _burner(on=True),
    ("knobs", "off"): _burner(on=False),
    ("navigation", "drive"): _driven,
    ("levers", "on"): lambda task, stage: StateIs(stage.target, "water_on"),
    ("levers", "off"): lambda task, stage: StateIs(stage.target, "water_on", value=False),
    ("pick_place", "pick"): lambda task, stage: Grasped(stage.object),
    ("pick_place", "place"): _placed,
    ("pick_place", "place_upside_down"): _upside_down,
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
        raise _needs_own(task, stage)
    return _BY_VERB[key](task, stage)


def _needs_own(task: BoundTask, stage: Stage) -> UserError:
    return UserError(
        f"{task.name}: the stage `{stage.skill} {stage.verb}` needs a condition of its own: what a {stage.verb} of "
        f"{stage.skill} comes to is not the same everywhere. Give the stage `until=...`."
    )


def without_gripper(goal: Goal) -> Goal:
    """What of a stage's condition must still hold when the hand is busy with the next one.

    Left out are where the gripper has to be, and that something moved in the last step, which passes by itself. Memory
    stays whole: steps that were counted remain.
    """
    if isinstance(goal, AllOf):
        return AllOf(*(without_gripper(part) for part in goal.parts if not _passes(part)))
    return AllOf() if _passes(goal) else goal


def _passes(goal: Goal) -> bool:
    moves = isinstance(goal, MovedSince) and goal.since == "step"
    return moves or isinstance(goal, GripperFar | GripperFarFromPart)


def must_never(goal: Goal) -> tuple[Never, ...]:
    """What a goal asks never to happen in any case: once it has, the goal cannot be reached any more."""
    if isinstance(goal, AllOf):
        return tuple(never for part in goal.parts for never in must_never(part))
    return (goal,) if isinstance(goal, Never) else ()
