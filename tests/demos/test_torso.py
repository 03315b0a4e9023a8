"""The torso goes up and down by actions, and no farther than nothing is in the way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from robocasa_lerobot.demos.motion import OPEN, grip_position
from robocasa_lerobot.demos.skills.pick_place.carrying.torso import EASY_M, MOST_M, move_torso, torso_for, torso_height
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.pick import best_grasp
from robocasa_lerobot.demos.skills.pick_place.turning.across import OUT_OF_CABINET
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

AS_IT_IS_M = 0.02


@pytest.fixture
def env() -> Iterator[KitchenEnv]:
    """Before an open wall cabinet with something on its shelf."""
    env = KitchenEnv("PickPlaceCabinetToCounter", split="pretrain", cameras=(), terminate_on_success=False)
    env.reset(seed=100_508)
    yield env
    env.close()


def _carry_out(env: KitchenEnv, wanted_m: float) -> None:
    for action in move_torso(env, wanted_m, OPEN):
        env.step(action.astype(np.float32))


def test_the_torso_goes_up_and_down_and_takes_the_hand_along(env: KitchenEnv) -> None:
    before = grip_position(env.data)
    _carry_out(env, 0.12)
    assert torso_height(env) == pytest.approx(0.12, abs=0.01)
    assert grip_position(env.data) - before == pytest.approx([0.0, 0.0, 0.12], abs=AS_IT_IS_M)
    _carry_out(env, 0.0)
    assert torso_height(env) == pytest.approx(0.0, abs=0.01)
    assert list(move_torso(env, 0.0, OPEN)) == []


def test_what_is_high_in_a_cabinet_is_grasped_better_with_the_torso_up(env: KitchenEnv) -> None:
    obj = graspable(env, "obj")
    before = best_grasp(env, obj, OUT_OF_CABINET).cost
    _carry_out(env, torso_for(float(env.data.body(obj.name).xpos[2])))
    assert best_grasp(env, obj, OUT_OF_CABINET).cost < before


def test_only_what_is_high_asks_for_it() -> None:
    assert torso_for(EASY_M) == 0.0
    assert torso_for(EASY_M + 0.2) == pytest.approx(0.2)
    assert torso_for(5.0) == MOST_M
