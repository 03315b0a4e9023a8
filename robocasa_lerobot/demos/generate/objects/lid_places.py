"""The lid of a blender: held by its knob, and put onto its jug, or onto the counter beside it."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.blender_lid import HOLD_M, free_spots, grasps, the_blender
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose, PlaceStrategy
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

COVER, UNCOVER = "cover", "uncover"
LID_VERBS = (COVER, UNCOVER)
DROP_M = 0.003
ALONG_RAD = 0.35  # of a hand's approach from the one that is asked for
ASKEW = 8.0  # cost of a radian that a square lid is turned from its jug
FARTHER = 0.02  # cost of each spot before which there is a nearer one


def knob_grasps(env: KitchenEnv, lid: Graspable, comes: Array) -> list[GraspPose]:
    """Grasps of the knob by a hand that comes about along `comes` (unit vector), the nearest first."""
    at = env.data.body(lid.name).xpos + HOLD_M * UP
    angles = [(float(np.arccos(np.clip(turn[:, 2] @ comes, -1.0, 1.0))), turn) for turn in grasps(env)]
    near = sorted((one for one in angles if one[0] < ALONG_RAD), key=lambda one: one[0])
    return [GraspPose(at, turn, 0.0, -angle) for angle, turn in near]


def lid_strategy(env: KitchenEnv, stage: Stage, lid: Graspable) -> PlaceStrategy:
    """How a lid is put down.

    Raises:
        SkillError: there is no room on the counter.
    """
    blender = the_blender(env, stage)
    if stage.verb == UNCOVER:
        spots = [PlacePose(spot, FARTHER * number) for number, spot in enumerate(free_spots(env, blender))]
        return PlaceStrategy(lambda: spots, gap_m=DROP_M)
    place, upright = blender.lid_pose[0], np.eye(3)
    square = blender.record["jug"] != "round"

    def fit(position: Array, rotation: Array) -> float:
        turned = float(np.arctan2(rotation[1, 0], rotation[0, 0])) - blender.yaw
        off = wrap(4.0 * turned) / 4.0
        return ASKEW * abs(off) if square else 0.0

    return PlaceStrategy(lambda: [PlacePose(place - lid.below(upright) * UP)], gap_m=DROP_M, exact=True, fit=fit)


def lid_turns(env: KitchenEnv, stage: Stage, yaw: float) -> list[float]:
    """Turns (radians) of a lid whose heading is `yaw` after which it is square to its jug."""
    blender = the_blender(env, stage)
    return [wrap(blender.yaw + quarter * np.pi / 2 - yaw) % (2 * np.pi) for quarter in range(4)]
