"""Segments about objects: taken hold of as in a source, and used or put down as there."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.demos.generate.course import BRIDGE, Course
from robocasa_lerobot.demos.generate.execute import as_target, hand_now
from robocasa_lerobot.demos.generate.objects.pick_segments import come_to_object, pick_as_shown
from robocasa_lerobot.demos.generate.objects.place_segments import place_as_shown
from robocasa_lerobot.demos.generate.objects.use_segments import use
from robocasa_lerobot.demos.generate.sources.uses import RINSE, USES
from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    Array,
)
from robocasa_lerobot.demos.planning.base_path import base_now
from robocasa_lerobot.demos.planning.errors import LostError
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.tools.rinse import parts_of_rinsing
from robocasa_lerobot.demos.skills.pick_place.verbs import MOST_PLACES
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

TRIES = 5  # of picking up and putting down together


def object_stage(env: KitchenEnv, stage: Stage, course: Course) -> Iterator[Array]:
    """Take hold of the stage's object, and use it or put it down if the stage says so, with segments of sources.

    Raises:
        SkillError: no source has such segments, none is within reach, or it is not done after all tries.
    """
    if stage.verb == RINSE:
        for part in parts_of_rinsing(env, stage):
            yield from object_stage(env, part, course)
        return
    name = graspable(env, stage.object).name
    if name not in course.rest:
        course.rest[name] = env.data.body(name).xmat.reshape(3, 3).copy()
    tried: list[Array] = []
    put_down: list[Array] = []
    in_vain: dict[int, int] = {}
    been: list[RobotPose] = []
    for _ in range(TRIES):
        if stage_done(env, stage):
            return
        obj = graspable(env, stage.object)
        if not is_held(env, obj.name):
            yield from come_to_object(env, stage, obj, course, been)
            try:
                yield from pick_as_shown(env, stage, obj, course, tried)
            except LostError:
                raise
            except SkillError:
                if course.manner.base == "fixed" or len(been) == MOST_PLACES - 1:
                    raise
                been.append(base_now(env.data))
                continue
            if not is_held(env, obj.name):
                continue
        if stage.verb == "pick":
            return
        if stage.verb in USES:
            yield from use(env, stage, obj, course, in_vain)
        else:
            yield from place_as_shown(env, stage, obj, course, put_down)
        for _ in range(15):
            if stage_done(env, stage):
                return
            fingers = CLOSED if is_held(env, obj.name) else OPEN
            yield from course.labelled(hold_hand(env.data, as_target(hand_now(env)), fingers, 1), BRIDGE)
    what = "was used in vain" if stage.verb in USES else "is not where it belongs"
    raise SkillError(f"{graspable(env, stage.object).title} {what} after {TRIES} tries")
