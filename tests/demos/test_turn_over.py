"""Objects that are to stand otherwise than they do are turned over in the hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos.motion import UP, hand_rotation
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.strategies import place_strategy
from robocasa_lerobot.demos.skills.pick_place.turn_over import to_turn, turned_hand, which_way_up
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import ObjectTilt
from robocasa_lerobot.envs.tasks.conditions import stage_condition


@pytest.fixture(scope="module")
def env() -> Iterator[KitchenEnv]:
    made = KitchenEnv("DryDrinkware", split="target", cameras=())
    made.reset(seed=2)
    yield made
    made.close()


def tilt(env: KitchenEnv, angle: float) -> None:
    """Turn the mug, in the air, about its x axis."""
    env.data.joint("mug_joint0").qpos[2] = 1.3
    env.data.joint("mug_joint0").qpos[3:] = [np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0]
    mujoco.mj_forward(env.model, env.data)


@pytest.mark.parametrize(("angle", "turns"), [(0.0, True), (np.pi / 2, True), (0.9 * np.pi, False), (np.pi, False)])
def test_only_what_is_the_wrong_way_up_is_turned(env: KitchenEnv, angle: float, turns: bool) -> None:
    tilt(env, angle)
    stage, mug = env.declaration.stages[-1], graspable(env, "mug")
    wanted = which_way_up(env, stage, mug)
    assert (wanted is not None) == turns
    assert (place_strategy(env, stage, mug).upwards is not None) == turns
    anyway = replace(stage, until=ObjectTilt("mug", low=0.4))
    assert which_way_up(env, anyway, mug) is None  # leaning is no side


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, 2.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_hand_that_turns_an_object(env: KitchenEnv, angle: float, side: float) -> None:
    tilt(env, angle)
    mug = graspable(env, "mug")
    hand = turned_hand(env, mug, side * UP)
    assert hand @ hand.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(hand) == pytest.approx(1.0)
    in_hand = hand_rotation(env.data).T @ env.data.body("mug").xmat.reshape(3, 3)
    assert (hand @ in_hand)[:, 2] == pytest.approx(side * UP, abs=1e-9)


def test_what_stands_is_grasped_across_its_body(env: KitchenEnv) -> None:
    tilt(env, 0.0)
    mug, base = graspable(env, "mug"), env.data.body("mug").xpos
    ways = [np.array([np.cos(way), np.sin(way), 0.0]) for way in np.linspace(0, 2 * np.pi, 16)]
    poses = [pose for way in ways for pose in to_turn(env, mug, way)]
    assert poses
    assert all(np.linalg.norm((pose.position - base)[:2]) < 0.04 for pose in poses)


def test_the_verb_asks_for_it_by_itself(env: KitchenEnv) -> None:
    tilt(env, 0.0)
    stage = replace(env.declaration.stages[-1], until=None)
    terms: dict[str, bool] = {}
    assert not stage_condition(env.declaration, stage).evaluate(env.scene, env.data, terms)
    assert set(terms) == {"mug_inside_cabinet", "gripper_far_from_mug", "mug_upside_down"}
    assert which_way_up(env, stage, graspable(env, "mug")) is not None
