"""What is held is carried where the base has room for it, and a full vessel stays level."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import UP, Array, rotation_about
from robocasa_lerobot.demos.planning.approach import MOST_TILT_RAD, Approach
from robocasa_lerobot.demos.planning.base_path import LOADED_MARGINS_M, base_now, find_free_path, find_path
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.planning.costs import REACHING
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.pick_place.carrying.fold_held import fold_with
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.verbs import is_held, pick_object
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

BOX = "meat_tupperware"
LEVEL_COS = np.cos(np.deg2rad(20.0))


@pytest.fixture(scope="module")
def freezer() -> Iterator[KitchenEnv]:
    env = KitchenEnv("SeparateFreezerRack", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=100_001)
    yield env
    env.close()


def test_a_full_box_is_folded_so_that_the_base_can_drive_to_an_open_freezer(freezer: KitchenEnv) -> None:
    env = freezer
    for step in pick_object(env, env.declaration.stages[0]):
        env.step(step)
    assert is_held(env, BOX)
    obj, stand = graspable(env, BOX), env.scene.standing_pose("fridge")
    for step in fold_with(env, obj, stand, np.asarray(env.scene.fixture("fridge").pos)):
        env.step(step)
    assert is_held(env, BOX)
    assert set(graspable(env, BOX).contents) == {"meat"}
    assert env.data.body(BOX).xmat[8] > LEVEL_COS
    held = Held.now(env.data, BOX, ("meat",))
    path = find_free_path(env.scene, env.data, base_now(env.data), stand, held, margins_m=LOADED_MARGINS_M[:2])
    assert path.margin_m >= LOADED_MARGINS_M[1][0]
    assert np.hypot(path.poses[-1].x - stand.x, path.poses[-1].y - stand.y) < 0.2
    assert find_path(env.scene, env.data, base_now(env.data), stand, held).margin_m == path.margin_m


def test_a_detour_with_a_full_vessel_keeps_it_level(freezer: KitchenEnv) -> None:
    """Round a ball in the middle of the way, from one side of the robot to the other."""
    arm = Arm(freezer.model, freezer.data, freezer.scene.robot)
    home = arm.home
    grips, hands = arm.forward(home[None])
    up = hands[0].T @ UP
    sides = [rotation_about(UP, turn) for turn in (0.7, -0.7)]
    ends = arm.solve(
        np.array([side @ (grips[0] + [0.2, 0.0, -0.1]) for side in sides]),
        np.array([side @ hands[0] for side in sides]),
        home + np.array([[0.7, 0, 0, 0, 0, 0, 0], [-0.7, 0, 0, 0, 0, 0, 0]]),
    )
    start, goal = ends.joints
    middle = arm.forward((start + goal)[None] / 2)[0][0]

    def counts(joints: Array, margin_m: float) -> NDArray[np.int64]:
        away = np.linalg.norm(arm.forward(joints)[0] - middle, axis=1)
        return (away < 0.1 + margin_m).astype(np.int64)

    def greatest_tilt(level: bool) -> float:
        found = Approach(arm, counts, REACHING, level=level).detour(start, goal, np.zeros(3))
        assert found is not None
        corners = np.vstack([start, found[0]])
        way = np.concatenate([a + np.linspace(0, 1, 20)[:, None] * (b - a) for a, b in itertools.pairwise(corners)])
        assert not counts(way, 0.0).any()
        return float(np.arccos(np.clip(arm.forward(way)[1] @ up @ UP, -1.0, 1.0)).max())

    assert greatest_tilt(level=True) <= MOST_TILT_RAD + 0.02
    assert greatest_tilt(level=False) > MOST_TILT_RAD
