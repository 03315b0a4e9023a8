"""From where the hand is to where a segment begins: round obstacles as planned, or along a line as published."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.demos.generate.execute import hand_now, pose_command
from robocasa_lerobot.demos.generate.select import LINE_STEPS, Manner
from robocasa_lerobot.demos.generate.sources.transform import interpolated
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.motion_planner import MotionPlan
from robocasa_lerobot.demos.skills.reaching import follow_with
from robocasa_lerobot.envs.kitchen_env import KitchenEnv


def bridged(
    env: KitchenEnv, manner: Manner, plan: MotionPlan, first: Array, gripper: float, held: Held | None = None
) -> Iterator[Array]:
    """Lead the hand to a segment's first pose (4, 4), with what it holds."""
    if manner.bridge == "line":
        for pose in interpolated(hand_now(env), first, LINE_STEPS):
            yield pose_command(env, pose, gripper)
    elif held is not None:
        yield from follow_with(env, plan.joints, held)
    else:
        yield from follow_joint_path(env, plan.joints, gripper)
