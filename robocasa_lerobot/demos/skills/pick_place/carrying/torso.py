"""The torso's height: up before what is high, where the arm would come with level or stretched links only, then down.

On the shelves of wall cabinets, which hang over counters that keep the base off, the arm as it stands reaches what
lies there with a level hand alone, and its palm meets the shelf before low things.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import FROM_DESIRED, Array, action
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import TORSO_SCALE_M

EASY_M = 1.25  # height of a point that the arm reaches from above and from before, with the torso down
MOST_M, LEAST_MOVE_M = 0.30, 0.04  # of the torso; smaller moves are not made
TEST_STEP_M = 0.03  # between tested heights
STEADY_M, MOST_STEPS = 0.004, 30
ARM_LINKS = tuple(range(1, 8))  # what rises with the torso, but for its column


def torso_height(env: KitchenEnv) -> float:
    """How far the torso is up, metres."""
    return float(env.data.joint(env.scene.robot.names.torso_joint).qpos[0])


def torso_for(height_m: float) -> float:
    """How far the torso should be up for the hand to reach a point of that height over the floor, metres."""
    return float(np.clip(height_m - EASY_M, 0.0, MOST_M))


def move_torso(env: KitchenEnv, wanted_m: float, gripper: float, held: Held | None = None) -> Iterator[Array]:
    """Bring the torso to a height, or as near to it as the arm, kept as it is, meets nothing more than it does now."""
    goal = _nearest_free(env, wanted_m, held)
    if abs(goal - torso_height(env)) < LEAST_MOVE_M:
        return
    for _ in range(MOST_STEPS):
        left = goal - torso_height(env)
        if abs(left) < STEADY_M:
            break
        # Half of what is commanded comes in a step.
        command = float(np.clip(2.0 * left / TORSO_SCALE_M, -1.0, 1.0))
        yield action(gripper=gripper, base=np.array([0.0, 0.0, 0.0, command]), mode=FROM_DESIRED)
    yield action(gripper=gripper, mode=FROM_DESIRED)


def _nearest_free(env: KitchenEnv, wanted_m: float, held: Held | None) -> float:
    """The height nearest to the wanted one up to which nothing is in the way."""
    now = torso_height(env)
    if abs(wanted_m - now) < LEAST_MOVE_M:
        return now
    checker = CollisionChecker(env.scene, env.data)
    base, joints = checker.present_base, checker.present_joints
    checker.allow(checker.touched(base, joints, held=held, most=8).all())
    count = max(int(np.ceil(abs(wanted_m - now) / TEST_STEP_M)), 1)
    reached = now
    for share in (np.arange(1, count + 1) / count).tolist():
        height = now + share * (wanted_m - now)
        met = checker.touched(base, joints, held=held, raised_m=height - now, links=ARM_LINKS, most=1).counts
        if met[0]:
            break
        reached = height
    return reached
