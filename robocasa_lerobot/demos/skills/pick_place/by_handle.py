"""Objects with a handle, such as spatulas and pans: which end works, and grasps of the other one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH, GraspStrategy
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, filled, grasps
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

END_SHARE = 0.25  # of the length, at each end, by whose width the working end is told
TIP_SHARE = 0.06
LONG = 1.5  # of a vessel with a handle, by its width
TOOL_SHARE, PAN_SHARE = 0.48, 0.60  # of the length, that a grasp is away from the tip at least
END_M = 0.02  # least distance of a grasp near an end from the middle
TOOL_SCORE, PAN_SCORE = 12.0, -12.0  # of a metre that it is farther away


@dataclass(frozen=True)
class WorkingEnd:
    """The end of a long object that is wider than the other.

    Attributes:
        tip: its farthest part, in the object's axes, metres.
        axis: unit vector from there to the other end, in the object's axes.
        length: of the object along that, metres.
    """

    tip: Array
    axis: Array
    length: float


def working_end(obj: Graspable) -> WorkingEnd:
    """Find the wider end of an object."""
    points = np.concatenate([filled(solid.cloud()) for solid in obj.solids])
    long = int(np.argmax(np.ptp(points[:, :2], axis=0)))
    low, high = float(points[:, long].min()), float(points[:, long].max())
    length = high - low

    def wide(inside: NDArray[np.bool_]) -> float:
        return float(np.ptp(points[inside, 1 - long]))  # as it lies; how high it is says nothing

    at_high = wide(points[:, long] > high - END_SHARE * length) >= wide(points[:, long] < low + END_SHARE * length)
    end = points[points[:, long] > high - TIP_SHARE * length if at_high else points[:, long] < low + TIP_SHARE * length]
    tip = (end.min(axis=0) + end.max(axis=0)) / 2
    tip[long] = high if at_high else low
    axis = np.zeros(3)
    axis[long] = -1.0 if at_high else 1.0
    return WorkingEnd(tip, axis, length)


def has_handle(obj: Graspable) -> bool:
    """Whether an object is a vessel with a long handle."""
    return (
        obj.item is not None
        and obj.item.interior is not None
        and max(obj.item.size[:2]) > LONG * min(obj.item.size[:2])
    )


def by_the_handle(
    env: KitchenEnv, obj: Graspable, approach: Array, *, share: float, farther_score: float
) -> list[GraspPose]:
    """Grasps beyond a share of the length from the working end, with a score for each metre from that."""
    end = working_end(obj)
    body = env.data.body(obj.name)
    turn = body.xmat.reshape(3, 3)
    found = []
    for pose in grasps(env, obj, approach, (end.axis, float(end.tip @ end.axis) + share * end.length)):
        far = float((turn.T @ (pose.position - body.xpos) - end.tip) @ end.axis)
        found.append(replace(pose, score=pose.score + farther_score * far))
    return sorted(found, key=lambda pose: -pose.score)


def by_one_end(env: KitchenEnv, obj: Graspable, approach: Array) -> list[GraspPose]:
    """Grasps off the middle of an object, to either end; any, where there are none."""
    found, axis = grasps(env, obj, approach), working_end(obj).axis
    body = env.data.body(obj.name)
    along = body.xmat.reshape(3, 3) @ axis
    return [pose for pose in found if abs(float((pose.position - body.xpos) @ along)) > END_M] or found


# A tool is held far from its working end, which reaches into something; a pan near it, since it hangs on that.
TOOL_BY_THE_HANDLE = replace(ANY_APPROACH, poses=partial(by_the_handle, share=TOOL_SHARE, farther_score=TOOL_SCORE))
PAN_BY_THE_HANDLE = replace(ANY_APPROACH, poses=partial(by_the_handle, share=PAN_SHARE, farther_score=PAN_SCORE))


def pan_grasp(obj: Graspable) -> GraspStrategy:
    """How a vessel is held that may be a pan: by its handle if it has one."""
    return PAN_BY_THE_HANDLE if has_handle(obj) else ANY_APPROACH


# What goes into a vessel with one end first is held near the other one: the palm stays over the rim.
BY_ONE_END = replace(ANY_APPROACH, poses=by_one_end)
