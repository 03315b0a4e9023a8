"""What is long goes into a glass with one end first."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from robocasa_lerobot.demos.motion import UP, Array, rotation_about
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.heaps import uppermost
from robocasa_lerobot.demos.skills.pick_place.place import upending_yaws
from robocasa_lerobot.demos.skills.pick_place.strategies import place_strategy
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

ACROSS = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def env() -> Iterator[KitchenEnv]:
    made = KitchenEnv("MakeChocolateMilk", split="target", cameras=())
    made.reset(seed=100_001)
    yield made
    made.close()


def test_a_bar_on_end_fits_in_the_mouth_and_one_that_leans_does_not(env: KitchenEnv) -> None:
    bar, glass = graspable(env, "chocolate2"), env.data.body("glass_milk").xpos
    strategy = place_strategy(env, env.declaration.stages[0], bar)
    rim = glass[2] + env.scene.objects["glass_milk"].item.size[2] / 2
    depths = [rim - pose.point[2] for pose in strategy.poses()]
    assert max(depths) > 0.03  # its end is in the glass before it is let go
    assert strategy.fit is not None
    costs = [strategy.fit(glass + 0.1 * UP, rotation_about(ACROSS, turn)) for turn in (np.pi / 2, np.pi / 3, 0.0)]
    assert costs[0] < 0.3 < costs[1] < costs[2]


def test_it_is_held_near_one_end(env: KitchenEnv) -> None:
    bar = graspable(env, "chocolate2")
    strategy = place_strategy(env, env.declaration.stages[0], bar)
    poses = strategy.grasp.poses(env, bar, -UP)
    assert poses
    assert all(np.linalg.norm((pose.position - env.data.body(bar.name).xpos)[:2]) > 0.02 for pose in poses)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.5, -0.8])
def test_the_hand_leans_about_the_line_between_its_fingers_alone(angle: float) -> None:
    down: Array = np.diag([1.0, -1.0, -1.0])
    hand = rotation_about(UP, angle) @ down
    for yaw in upending_yaws(hand, ACROSS):
        assert abs((rotation_about(UP, float(yaw)) @ hand)[:, 1] @ ACROSS) == pytest.approx(1.0)


def test_what_lies_beside_a_heap_need_not_wait_for_it(env: KitchenEnv) -> None:
    stages = env.declaration.stages
    assert [stage.object for stage in stages] == ["chocolate2", "sugar_cube"]
    assert uppermost(env, stages, 0) == 0
