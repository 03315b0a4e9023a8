"""Turn over what is held: which way up an object is to stand, the hand that brings it there, grasps that allow it.

A hand that comes level may roll half a turn about its own fingers and is level again; one that came from above would
have to come from below. So what is to be turned over is grasped from the side, across its body or by its handle.
"""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, hand_rotation, rotation_about, turned_up
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import GraspStrategy, in_radians
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, grasps
from robocasa_lerobot.demos.skills.pick_place.mugs import across_body, stands_for
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.predicates.objects import ObjectTilt, ObjectUpright
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

OVER_RAD = float(np.deg2rad(50.0))  # from how it is to stand, from which on an object is turned
HEIGHTS_M = (0.045, 0.052, 0.038)  # of a level hand above the foot of a vessel
ASKEW = 0.5  # what a score loses by a radian between the hand and the base's heading
SWINGS_M = 0.02  # of the line between the fingers beside an object's centre of mass: farther off it would swing
END_FIRST = tuple(float(np.deg2rad(lean)) for lean in (90.0, 83.0, 97.0))  # of the hand, of what lies flat in it
# Of what comes to stand on its rim: the hand may be level, or lower than that, since it settles by itself.
LEANS = tuple(float(np.deg2rad(lean)) for lean in (0.0, -10.0, -20.0))


def to_turn(env: KitchenEnv, obj: Graspable, approach: Array) -> list[GraspPose]:
    """Grasps of a level hand in which an object does not swing: across the body of a vessel, or about its middle."""
    if stands_for(env, obj, approach):
        return across_body(env, obj, approach, HEIGHTS_M, ASKEW)
    middle = env.data.body(obj.name).xipos.copy()
    return [pose for pose in grasps(env, obj, approach) if _beside(pose, middle) < SWINGS_M]


def _beside(pose: GraspPose, point: Array) -> float:
    """How far the line between the fingers is from a point on the floor plan, metres."""
    away, opens = pose.position - point, pose.rotation[:, 1]
    return float(np.linalg.norm((away - (away @ opens) * opens)[:2]))


TO_TURN = GraspStrategy(
    in_radians((84, 0.0), (78, 0.05), (90, 0.05), (70, 0.4)),
    ("up", "across", "out"),
    turns=tuple(float(np.deg2rad(turn)) for turn in (0.0, 20.0, -20.0, 45.0, -45.0, 65.0, -65.0)),
    poses=to_turn,
)


def which_way_up(env: KitchenEnv, stage: Stage, obj: Graspable) -> Array | None:
    """Where an object's own z axis (3,) is to point in the end, where that is far from how it is now; else None."""
    up = float(env.data.body(obj.name).xmat[8])
    for term in every_goal_in(stage_condition(env.declaration, stage)):
        if not isinstance(term, ObjectTilt | ObjectUpright) or env.scene.fill(term.object) != obj.name:
            continue
        if isinstance(term, ObjectUpright) or term.high < np.pi / 2:
            wanted: Array = UP
        elif term.low > np.pi / 2:
            wanted = -UP
        else:
            continue
        if up * wanted[2] < np.cos(OVER_RAD):
            return wanted
    return None


def stands_askew(env: KitchenEnv, stage: Stage, obj: Graspable) -> bool:
    """Whether an object is to be tilted from how it lies by its stage, but not turned over."""
    return any(
        isinstance(term, ObjectTilt) and env.scene.fill(term.object) == obj.name and 0.0 < term.low < np.pi / 2
        for term in every_goal_in(stage_condition(env.declaration, stage))
    )


def turned_hand(env: KitchenEnv, obj: Graspable, wanted: Array) -> Array:
    """The hand's rotation (3, 3) with which an object that it holds points its own z axis along `wanted`, up or down.

    What is to be turned over altogether is rolled about the level direction along the hand.
    """
    present = hand_rotation(env.data)
    turn = env.data.body(obj.name).xmat.reshape(3, 3)
    roll = np.eye(3)
    if float(turn[:, 2] @ wanted) < 0.0:
        along = present[:, 2] * [1.0, 1.0, 0.0]
        roll = rotation_about(along / np.linalg.norm(along), np.pi)
    rolled = roll @ turn
    stands = turned_up(rolled, np.array([0.0, 0.0, float(wanted[2])]))
    hand: Array = stands @ rolled.T @ roll @ present
    return hand
