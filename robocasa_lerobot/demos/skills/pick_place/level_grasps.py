"""Grasps of flat objects under a roof: the hand comes along a slope, its fingers stay level."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.pick_place.graspable import DOWN, Graspable, filled, grasps
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

PALM_HALF_M, GIVES_WAY_M = (0.028, 0.10), 0.004  # along the hand's x and y; food yields a little
GAP_M = 0.002  # between the fingers' lowest corners and what the object lies on
INWARDS = 0.5  # least cosine between the hand's heading and the approach's


def level_grasps(env: KitchenEnv, obj: Graspable, approach: Array) -> list[GraspPose]:
    """Grasps from above, tipped over the line between the fingers until the hand looks along an approach's slope.

    The fingers stay level and close on the same sides of the object; the hand is as high as its lower corners ask for.
    Grasps that keep the approach as it is come after them.
    """
    ahead = approach - (approach @ UP) * UP
    steepness = float(-approach @ UP)
    flat = float(np.linalg.norm(ahead))
    body = env.data.body(obj.name)
    turn = body.xmat.reshape(3, 3)
    gripper = env.robot.gripper
    pad_half_width, pad_reach = gripper.pad_corner
    lowest = float(body.xpos[2]) - obj.below(turn) + pad_reach * steepness + pad_half_width * flat + GAP_M
    points = body.xpos + np.concatenate([filled(solid.cloud()) for solid in obj.solids]) @ turn.T
    found = []
    for pose in grasps(env, obj, DOWN):
        opening = pose.rotation[:, 1]
        heading = np.cross(UP, opening)
        heading *= np.sign(heading @ ahead)
        if float(heading @ ahead) < INWARDS * flat:
            continue
        z = flat * heading - steepness * UP
        position = pose.position.copy()
        position[2] = max(position[2] - (gripper.tips_below_grip - pad_reach), lowest)
        rotation = np.column_stack([np.cross(opening, z), opening, z])
        x, y, deep = ((points - position) @ rotation).T
        if np.any(
            (np.abs(x) < PALM_HALF_M[0])
            & (np.abs(y) < PALM_HALF_M[1])
            & (deep < -(gripper.palm_above_grip + GIVES_WAY_M))
        ):
            continue
        found.append(GraspPose(position, rotation, pose.width, pose.score))
    return found + grasps(env, obj, approach, over_floor=True)
