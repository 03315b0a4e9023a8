"""Press onto an object with the working end of a long tool, for as long as the stage asks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, arm_action, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import SkillError, move_hand, stage_done, wait_for_stage
from robocasa_lerobot.demos.skills.pick_place.by_handle import TOOL_BY_THE_HANDLE
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.tools.brought import bring
from robocasa_lerobot.demos.skills.pick_place.tools.stir import plan_tip
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, approach, follow_with
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.predicates.objects import object_corners
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 3
SIDE_M = 0.02  # that the arm must reach round the middle of what is pressed
FIRM_M, LOWEST_M = 0.006, 0.05  # of the hand below where the tool first touched; below the object's top, at most
PATIENCE_STEPS = 15  # without another step that counts
AWAY_M = 0.28


def press_with(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Bring the tool, the stage's object, down onto the stage's target, hold it there, and go away upwards.

    A tool that is not in the hand is picked up first.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    data, target = env.data, env.scene.fill(stage.target)
    for _ in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        yield from bring(env, obj, target, TOOL_BY_THE_HANDLE)
        choice = yield from approach(env, partial(_choose, env, obj, target), CLOSED, Held.now(data, obj.name))
        yield from follow_with(env, choice.joints, Held.now(data, obj.name))
        over, at, *_ = choice.path.targets
        yield from move_hand(data, over, CLOSED, tolerance=0.02, max_steps=80)
        met = partial(touching, env.model, data, env.scene.subtree(obj.name), env.scene.subtree(target))
        low = HandTarget(at.position - LOWEST_M * UP, at.rotation)
        yield from move_hand(data, low, CLOSED, speed=0.3, max_steps=120, until=met, start=over.position)
        firm = HandTarget(grip_position(data) - FIRM_M * UP, hand_rotation(data))
        yield from wait_for_stage(env, stage, partial(arm_action, data, firm, CLOSED, speed=0.5), PATIENCE_STEPS)
        yield from move_hand(data, over, CLOSED, speed=0.7, tolerance=0.03, max_steps=50)
        away = HandTarget(over.position + AWAY_M * UP, over.rotation)
        yield from move_hand(data, away, CLOSED, tolerance=0.03, max_steps=50, until=lambda: stage_done(env, stage))
        if stage_done(env, stage):
            return
    raise SkillError(f"{graspable(env, stage.object).title} was pressed onto {target} in vain {ATTEMPTS} times")


def _choose(env: KitchenEnv, obj: Graspable, target: str, blocked: Sequence[RobotPose]) -> MotionPlan:
    corners = object_corners(env.scene, env.data, target)
    middle = env.data.body(target).xpos
    top = np.array([middle[0], middle[1], float(corners[:, 2].max())])
    return plan_tip(env, obj, top, float(top[2]), SIDE_M, blocked, where=f"onto {target}")
