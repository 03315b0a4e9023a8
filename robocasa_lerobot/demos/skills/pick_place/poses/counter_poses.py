"""Where on a counter an object can be put down: near the robot, where nothing stands."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, base_pose, grip_position
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import PlacePoses
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter

GRID_M, EDGE_M, NEAR_M = 0.07, 0.02, 0.75
MOST_POSES = 14
FARTHER_M = 1.5  # of a free place from the base, where there is none near it
BESIDE_M, MOST_BESIDE = 0.32, 40  # of places that it is to come beside
FAR_COST = 0.8  # for each metre


def on_counter(
    env: KitchenEnv, obj: Graspable, counter: Counter, within_m: float = NEAR_M, beside: Sequence[Array] = ()
) -> PlacePoses:
    """Points on a counter's top, near the robot, where an object as it is turned now meets nothing.

    With places `beside` which it is to come, world, metres, each (3,), points near these, wherever the robot is.
    Where there is no room near the robot, points farther off, to which it drives.
    """

    def poses() -> list[PlacePose]:
        return free_within(within_m) or ([] if beside else free_within(FARTHER_M))

    def free_within(within_m: float) -> list[PlacePose]:
        body = env.data.body(obj.name)
        turn = body.xmat.reshape(3, 3).copy()
        edge = float(max(obj.half_extents(turn)[:2])) + EDGE_M
        model, scratch = env.model, copy.copy(env.data)
        mine = np.isin(model.geom_bodyid, list(obj.bodies))
        others = ~np.isin(model.geom_bodyid, list(obj.bodies | obj.carried))
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, turn.reshape(9))
        found = []
        for point, far in _near(env, counter, edge, within_m, beside):
            origin = point + (obj.below(turn) + 0.004) * UP
            scratch.joint(f"{obj.name}_joint0").qpos[:] = [*origin, *quat]
            mujoco.mj_kinematics(model, scratch)
            mujoco.mj_collision(model, scratch)
            pairs = scratch.contact.geom if scratch.ncon else np.zeros((0, 2), dtype=np.int32)
            met = (mine[pairs[:, 0]] & others[pairs[:, 1]]) | (mine[pairs[:, 1]] & others[pairs[:, 0]])
            if not met.any():
                found.append(PlacePose(point, FAR_COST * far))
            if len(found) == (MOST_BESIDE if beside else MOST_POSES):
                break
        return found

    return poses


def _near(
    env: KitchenEnv, counter: Counter, edge: float, within_m: float, beside: Sequence[Array]
) -> list[tuple[Array, float]]:
    """Points of a grid on a counter with their distances from the hand, or from places beside, the nearest first."""
    cos, sin = np.cos(counter.yaw), np.sin(counter.yaw)
    base, _ = base_pose(env.data)
    grip = grip_position(env.data)
    found = []
    for x0, x1, y0, y1 in counter.solid_rectangles():
        for x in np.arange(x0 + edge, x1 - edge + 1e-9, GRID_M):
            for y in np.arange(y0 + edge, y1 - edge + 1e-9, GRID_M):
                point = np.array(
                    [counter.pos[0] + cos * x - sin * y, counter.pos[1] + sin * x + cos * y, counter.surface_z]
                )
                if beside:
                    apart = min(float(np.linalg.norm((point - other)[:2])) for other in beside)
                    if apart < BESIDE_M:
                        found.append((point, apart))
                elif np.linalg.norm((point - base)[:2]) < within_m:
                    found.append((point, float(np.linalg.norm((point - grip)[:2]))))
    return sorted(found, key=lambda pair: pair[1])
