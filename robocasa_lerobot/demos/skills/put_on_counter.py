"""Put an object down on a counter where nothing stands.

What fails lies far under the
counter or is longer than a shelf is deep. For CoffeeServeMug see `cups`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import replace

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, base_pose, grip_position
from robocasa_lerobot.demos.skills.cups import UNDER_A_SPOUT
from robocasa_lerobot.demos.skills.drawers import drag_open
from robocasa_lerobot.demos.skills.level_grasps import level_grasps
from robocasa_lerobot.demos.skills.pick import ANYHOW, FROM_ABOVE, Manner, best_way
from robocasa_lerobot.demos.skills.put import Putting, Spot, move
from robocasa_lerobot.demos.skills.put_down import done_when
from robocasa_lerobot.demos.skills.things import Thing, thing
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.tasks.task import Stage

GRID_M, EDGE_M, NEAR_M = 0.07, 0.02, 0.75
OUT_OF_CABINET = replace(ANYHOW, narrow=True, poses=level_grasps)
# Out of a drawer, whose hind part is below the counter: straight up to over its top.
OUT_OF_DRAWER = replace(
    FROM_ABOVE,
    tilts=((0.0, 0.0), (np.deg2rad(20.0), 0.1), (np.deg2rad(30.0), 0.2), (np.deg2rad(45.0), 0.3)),
    entries=("up", "across"),
    out_m=0.30,
    narrow=True,
    hover_m=0.26,
    lift_m=0.30,
)
HARD, FARTHER_OUT_M = 1.0, 0.12  # cost from which on it is pulled out farther first, and how far
FARTHER_M = 1.1  # where an open drawer keeps the robot off
MOST_SPOTS = 14
FAR_COST = 0.8  # for each metre


def place_on_counter(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the stage's object down on the counter that is its target.

    Raises:
        SkillError: it is not there after all attempts.
    """
    yield from _move(env, stage, OUT_OF_CABINET)


def take_from_spout(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Take a mug from under a spout, and put it down on the counter that is the stage's target.

    Raises:
        SkillError: it is not there after all attempts.
    """
    yield from _move(env, stage, UNDER_A_SPOUT)


def take_out_of_drawer(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Take an object out of an open drawer, from above, and put it down on the counter that is the stage's target.

    Raises:
        SkillError: it is not there after all attempts.
    """
    yield from _move(env, stage, replace(OUT_OF_DRAWER, first=_clear_of_counter(thing(env, stage.object))), FARTHER_M)


def _clear_of_counter(what: Thing) -> Callable[[KitchenEnv], Iterator[Array]]:
    """Before a grasp: pull the drawer farther out where the counter over it is in the way, or where a grasp failed."""
    again = False

    def first(env: KitchenEnv) -> Iterator[Array]:
        nonlocal again
        drawer = env.scene.fixture("drawer", Drawer)
        if again or best_way(env, what, OUT_OF_DRAWER).cost > HARD:
            yield from drag_open(env, drawer, 1.0 + FARTHER_OUT_M / drawer.full_travel)
        again = True

    return first


def _move(env: KitchenEnv, stage: Stage, taking: Manner, within_m: float = NEAR_M) -> Iterator[Array]:
    what = thing(env, stage.object)
    how = Putting(
        free_spots(env, what, stage.target, within_m),
        done_when(env, stage),
        leans=(0.0, np.deg2rad(30.0)),
        entries=("up", "across"),
        taking=taking,
    )
    yield from move(env, what, how)


def free_spots(env: KitchenEnv, what: Thing, role: str, within_m: float = NEAR_M) -> Callable[[], list[Spot]]:
    """Points on a counter's top, near the robot, where a thing as it is turned now meets nothing."""
    counter = env.scene.fixture(role, Counter)

    def spots() -> list[Spot]:
        body = env.data.body(what.name)
        turn = body.xmat.reshape(3, 3).copy()
        edge = float(max(what.half_extents(turn)[:2])) + EDGE_M
        near = _near(env, counter, edge, within_m)
        model, scratch = env.model, copy.copy(env.data)
        mine = np.isin(model.geom_bodyid, list(what.bodies))
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, turn.reshape(9))
        found = []
        for point, far in near:
            origin = point + (what.below(turn) + 0.004) * UP
            scratch.joint(f"{what.name}_joint0").qpos[:] = [*origin, *quat]
            mujoco.mj_kinematics(model, scratch)
            mujoco.mj_collision(model, scratch)
            inside = mine[scratch.contact.geom] if scratch.ncon else np.zeros((0, 2), dtype=bool)
            if not (inside[:, 0] != inside[:, 1]).any():
                found.append(Spot(point, FAR_COST * far))
            if len(found) == MOST_SPOTS:
                break
        return found

    return spots


def _near(env: KitchenEnv, counter: Counter, edge: float, within_m: float) -> list[tuple[Array, float]]:
    """Points of a grid on a counter with their distances from the hand, the nearest first."""
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
                if np.linalg.norm((point - base)[:2]) < within_m:
                    found.append((point, float(np.linalg.norm((point - grip)[:2]))))
    return sorted(found, key=lambda pair: pair[1])
