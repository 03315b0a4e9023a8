"""Hold mugs by their bodies: a nearly level hand from the side, a finger at each end of a diameter.

So the hand fits under a spout and below the handle of a portafilter, and what the fingers press does not turn in them.
What fails: the mug is grasped beside its middle, and slips while it is carried.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, frame
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import GraspStrategy, ahead_of, in_radians
from robocasa_lerobot.demos.skills.pick_place.graspable import UPRIGHT_COS, Graspable, grasps
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

WIDEST_M = 0.081  # at the rim; a mug's body is a little narrower where the fingers are
LEVEL_RAD = np.deg2rad(25.0)  # a hand that looks down more than this meets the rim with its palm
# Of the grip above what the object stands on: so low that the hand passes below spouts and handles of portafilters.
HEIGHTS_M = (0.035, 0.045)
HANDLE_BEHIND = 0.35  # of the handle's direction along the approach: less would block a finger
HANDLE_M = 0.008  # what stands out farther than this from the body is the handle
UPPER, ASKEW = 0.3, 4.0  # what a score loses by a higher grip, and by a radian beyond a small angle to the heading
SMALL_RAD = np.deg2rad(21.0)


def from_the_side(env: KitchenEnv, obj: Graspable, approach: Array) -> list[GraspPose]:
    """Grasps across the body where the hand comes level and the object stands; else of whatever kind there is."""
    return across_body(env, obj, approach) if stands_for(env, obj, approach) else grasps(env, obj, approach)


def stands_for(env: KitchenEnv, obj: Graspable, approach: Array) -> bool:
    """Whether an object is a vessel that stands, and a hand that comes along `approach` is nearly level."""
    level = np.hypot(approach[0], approach[1]) > np.cos(LEVEL_RAD)
    vessel = obj.item is not None and obj.item.interior is not None
    return bool(level and vessel and env.data.body(obj.name).xmat[8] > UPRIGHT_COS)


def across_body(
    env: KitchenEnv,
    obj: Graspable,
    approach: Array,
    heights: tuple[float, ...] = HEIGHTS_M,
    askew: float = ASKEW,
) -> list[GraspPose]:
    """Grasps across the body of a vessel that stands, by a level hand, at heights above its foot, metres.

    A radian between the hand and the base's heading, beyond a small one, lowers the score by `askew`.
    """
    assert obj.item is not None
    assert obj.item.interior is not None
    radius = float(min(obj.item.size[:2])) / 2
    body = env.data.body(obj.name)
    turn = body.xmat.reshape(3, 3)
    middle = np.array([*obj.item.interior.center[:2], 0.0])
    if 2 * radius > WIDEST_M:
        return []
    ahead = np.array([*approach[:2], 0.0]) / np.hypot(approach[0], approach[1])
    behind = 1.0
    handle = handle_of(obj)
    if handle is not None:
        behind = float(turn @ handle @ ahead)
    if behind < HANDLE_BEHIND:
        return []
    rotation = frame(approach, np.cross(UP, ahead))
    # As deep as the palm lets it.
    short = max(radius - env.robot.gripper.palm_above_grip, 0.0)
    foot = body.xpos + turn @ middle - obj.below(turn) * UP
    score = min(behind, 0.6) - askew * max(float(np.arccos(np.clip(ahead @ ahead_of(env), -1, 1))) - SMALL_RAD, 0.0)
    return [
        GraspPose(foot + height * UP - short * approach, rotation, 2 * radius, score - UPPER * index)
        for index, height in enumerate(heights)
    ]


def handle_of(obj: Graspable) -> Array | None:
    """Unit vector (3,) from the middle of a vessel to its handle, in its own axes; None of what has none."""
    if obj.item is None or obj.item.interior is None:
        return None
    away = obj.cloud - np.array([*obj.item.interior.center[:2], 0.0])
    out = np.linalg.norm(away[:, :2], axis=1)
    if out.max() <= float(min(obj.item.size[:2])) / 2 + HANDLE_M:
        return None
    handle: Array = away[out.argmax()] * [1.0, 1.0, 0.0] / out.max()
    return handle


FROM_THE_SIDE = GraspStrategy(
    in_radians((78, 0.0), (84, 0.05), (60, 0.5)),
    ("up", "across", "out"),
    turns=tuple(float(np.deg2rad(turn)) for turn in (20.0, -20.0, 0.0, 45.0, -45.0)),
    poses=from_the_side,
)

UNDER_A_SPOUT = dataclasses.replace(FROM_THE_SIDE, entries=("out", "level"), out_m=0.17)
