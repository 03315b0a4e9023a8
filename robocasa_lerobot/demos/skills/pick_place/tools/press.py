"""Press what is in the hand down on an object, level, for as long as the stage asks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, rotation_about
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.carrying.level import levelled
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.pick import INTEGRAL_GAIN, is_held
from robocasa_lerobot.demos.skills.pick_place.tools.brought import bring
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
YAWS = 8
ABOVE_M, OVER_M = 0.12, 0.02  # of the path in, and over the target before it comes down on it
PRESS_M = 0.006  # of the object's underside below the target's top, as the hand is told
PRESS_STEPS, TURN_COST = 40, 0.08


def press(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Press the stage's object on its target, an object, until the stage is done; it stays in the hand.

    An object that is not in the hand is picked up first.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    target = env.scene.fill(stage.target)
    for _ in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        yield from bring(env, obj, target, ANY_APPROACH)
        held = Held.now(env.data, obj.name)
        choice = yield from approach(env, partial(_choose, env, obj, target), CLOSED, held)
        yield from follow_with(env, choice.joints, Held.now(env.data, obj.name))
        above, over, down = choice.path.targets
        yield from move_hand(env.data, above, CLOSED, tolerance=0.03, max_steps=60)
        yield from move_hand(env.data, over, CLOSED, tolerance=0.012, max_steps=50)
        yield from move_hand(
            env.data, down, CLOSED, speed=0.5, tolerance=0.004, max_steps=25, integral_gain=INTEGRAL_GAIN
        )
        for _ in range(PRESS_STEPS):
            if stage_done(env, stage):
                return
            if not is_held(env, obj.name):
                break
            yield from hold_hand(env.data, down, CLOSED, 1)
        yield from move_hand(env.data, above, CLOSED, tolerance=0.03, max_steps=60)
    raise SkillError(f"{graspable(env, stage.object).title} was pressed on {target} in vain {ATTEMPTS} times")


def _choose(env: KitchenEnv, obj: Graspable, target: str, blocked: Sequence[RobotPose]) -> MotionPlan:
    """The turn about the vertical that the arm takes best, the object level over the middle of the target.

    Raises:
        SkillError: there is none.
    """
    data = env.data
    held = Held.now(data, obj.name)
    top = data.body(target).xpos + UP * env.scene.objects[target].item.top_offset
    level = levelled(data.body(obj.name).xmat.reshape(3, 3))
    paths = []
    for index in range(YAWS):
        yaw = 2 * np.pi * index / YAWS
        turn = rotation_about(UP, yaw) @ level
        rotation = turn @ held.rotation.T
        at = top + (obj.below(turn) - PRESS_M) * UP - rotation @ held.position
        row = tuple(HandTarget(at + lift * UP, rotation) for lift in (ABOVE_M, OVER_M + PRESS_M, 0.0))
        paths.append(WaypointPath(row, TURN_COST * min(yaw, 2 * np.pi - yaw)))
    allowed = obj.bodies | frozenset(np.flatnonzero(env.scene.subtree(target)).tolist())
    found = plan_reach(env, paths, top, key=1, held=held, loaded=3, allowed=allowed, blocked=blocked)
    if not found:
        raise SkillError(f"{obj.title}: there is no way to press it on {target}")
    return found[0]
