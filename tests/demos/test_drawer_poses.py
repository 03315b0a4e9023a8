"""A drawer that is partly open: only what has no counter over it is used, as things fit there; its front is dragged."""

from __future__ import annotations

import numpy as np
import pytest

from robocasa_lerobot.demos.motion import rotation_about
from robocasa_lerobot.demos.skills.drawers import drag_open
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.poses.drawer_poses import fits_in_drawer, in_drawer, open_part
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer


@pytest.fixture(scope="module")
def env() -> KitchenEnv:
    """A kitchen with a drawer that is half open, and a spoon for it."""
    kitchen = KitchenEnv("CountertopCleanup", split="target", cameras=(), terminate_on_success=False)
    kitchen.reset(seed=0)
    return kitchen


def test_all_poses_are_before_the_counter_over_the_drawer(env: KitchenEnv) -> None:
    drawer, counter = env.scene.fixture("drawer", Drawer), env.scene.fixture("counter")
    (inside,) = drawer.regions.values()
    free = open_part(env, drawer)
    assert 0.03 < free.half[1] < inside.half[1]
    assert free.half[0] == inside.half[0]
    edge = -counter.depth / 2
    poses = in_drawer(env, drawer)()
    assert poses
    for pose in poses:
        assert counter.to_local(pose.point)[1] < edge
        assert inside.contains(env.data, pose.point + np.array([0.0, 0.0, 0.001]))


def test_what_is_long_goes_in_across_and_flat(env: KitchenEnv) -> None:
    drawer, spoon = env.scene.fixture("drawer", Drawer), graspable(env, "utensil")
    fit, middle = fits_in_drawer(env, spoon, drawer), open_part(env, drawer).world(env.data)
    extents = np.ptp(spoon.cloud, axis=0)
    longest = int(np.argmax(extents))
    turns = {angle: rotation_about(np.array([0.0, 0.0, 1.0]), drawer.yaw + angle) for angle in (0.0, np.pi / 2)}
    costs = {angle: fit(middle, turn) for angle, turn in turns.items()}
    across = 0.0 if longest == 0 else np.pi / 2
    along = np.pi / 2 - across
    assert costs[across] < 0.2 < costs[along]
    upright = (
        rotation_about(np.array([0.0, 1.0, 0.0]), np.pi / 2)
        if longest == 0
        else rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2)
    )
    assert fit(middle, turns[across] @ upright) > costs[across] + 0.2


def test_a_drawer_is_dragged_farther_out_by_the_edge_of_its_front() -> None:
    env = KitchenEnv("PlaceStraw", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=2)
    drawer = env.scene.fixture("drawer", Drawer)
    assert drawer.openness(env.data) < 0.6
    for action in drag_open(env, drawer):
        env.step(action)
    assert drawer.openness(env.data) > 0.95
