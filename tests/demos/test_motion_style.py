"""Motion style: each demonstration has a style of its own, which follows from its seed and is written down."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.motion import CLOSED, FROM_DESIRED, OPEN, action
from robocasa_lerobot.demos.motion_style import PLAIN, MotionStyle, give_motion_style, motion_style_of
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

_POSITION = contract.ACTION_SLICES["end_effector_position"]


def test_draws_follow_from_the_generator_and_stay_in_their_ranges() -> None:
    drawn = [MotionStyle.draw(np.random.default_rng([seed, 6])) for seed in range(200)]
    assert drawn[7] == MotionStyle.draw(np.random.default_rng([7, 6]))
    assert len(set(drawn)) == 200
    speeds, bows = np.array([v.speed for v in drawn]), np.array([v.bow_rad for v in drawn])
    assert 0.85 <= speeds.min() < 0.87
    assert 0.97 < speeds.max() <= 1.0
    assert -0.1 <= bows.min() < -0.09
    assert 0.09 < bows.max() <= 0.1
    assert all(np.linalg.norm(v.hand) == pytest.approx(1.0) for v in drawn)


def test_the_preference_is_greatest_for_the_hand_that_is_preferred() -> None:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    style = MotionStyle(weight=0.2)
    turns = np.array([np.eye(3), quarter, np.diag([-1.0, -1.0, 1.0])])
    assert style.bonuses(turns) == pytest.approx([0.2, 0.1, 0.0])
    assert not PLAIN.bonuses(turns).any()


def test_fast_commands_are_slowed_and_bowed_and_fine_ones_stay() -> None:
    style = MotionStyle(speed=0.8, bow_rad=0.1)
    fine = action(position=np.array([0.3, -0.8, 0.1]), rotation=np.array([0.9, 0.0, 0.0]), gripper=OPEN)
    assert np.array_equal(style.carry_out(fine), fine)
    fast = action(position=np.array([1.0, 0.0, 0.5]), gripper=OPEN)
    bowed = style.carry_out(fast)[_POSITION]
    assert np.arctan2(bowed[1], bowed[0]) == pytest.approx(0.1)
    assert np.abs(bowed).max() == pytest.approx(0.8)
    pulled = style.carry_out(action(position=np.array([1.0, 0.0, 0.5]), gripper=CLOSED))[_POSITION]
    assert np.allclose(pulled, [0.8, 0.0, 0.4])  # what is held keeps its path
    both = action(position=np.array([0.5, 0.0, 0.0]), gripper=CLOSED, base=np.array([0.5, 0.0, 0.0, 0.0]))
    assert np.array_equal(style.carry_out(both), both)  # arm and base keep step
    driven = style.carry_out(action(gripper=OPEN, base=np.array([1.0, 0.2, -0.21, 0.0]), mode=FROM_DESIRED))
    # What is beyond the dead zones of 0.25 (0.11 of the turn) is scaled.
    assert np.allclose(driven[contract.ACTION_SLICES["base_motion"]], [0.85, 0.2, -0.19, 0.0])
    assert np.array_equal(PLAIN.carry_out(fast), fast)
    assert np.abs(style.carry_out(action(position=np.ones(3), gripper=OPEN))).max() <= 1.0


def test_a_hand_waits_beside_the_straight_line_to_its_goal() -> None:
    approach = np.array([0.0, 0.96, -0.28])  # forwards and a little downwards
    assert np.array_equal(PLAIN.beside(approach), np.zeros(3))
    across, up, along = (MotionStyle(wait_m=wait).beside(approach) for wait in np.eye(3).tolist())
    assert np.allclose(across, [1.0, 0.0, 0.0])
    assert np.allclose(along, approach)
    assert up[2] > 0.9
    assert abs(up @ approach) < 1e-12
    assert np.allclose(MotionStyle(wait_m=(1.0, 0.0, 0.0)).beside(np.array([0.0, 0.0, -1.0])), [1.0, 0.0, 0.0])


@pytest.mark.parametrize("seed", [0, 1])
def test_a_drawer_is_opened_from_beside_its_handle(seed: int) -> None:
    """The hands of varied demonstrations wait at different places, and all come straight at the handle from there."""

    def before_closing(varied: bool) -> np.ndarray:
        env = KitchenEnv("OpenDrawer", cameras=(), terminate_on_success=False)
        recording = record_episode(env, seed, varied=varied)
        env.close()
        assert recording.success
        closing = int(np.argmax(recording.actions[:, 6] > 0))
        positions = np.asarray(recording.observations["robot0_base_to_eef_pos"])
        return np.asarray(positions[closing - 25 : closing] - positions[closing])

    apart = np.linalg.norm(before_closing(True) - before_closing(False), axis=1)
    assert apart[:5].max() > 0.02
    assert apart[-5:].max() < 0.015


def test_an_env_has_the_motion_style_of_its_demonstration() -> None:
    env, other = (KitchenEnv("OpenDrawer", cameras=()) for _ in range(2))
    give_motion_style(env, MotionStyle(speed=0.8))
    assert motion_style_of(env).speed == 0.8
    assert motion_style_of(other) is PLAIN
    with pytest.raises(Exception, match="reset"):
        next(demonstrate(env))
    assert motion_style_of(env) is PLAIN  # every demonstration starts with its own


@pytest.mark.slow
@pytest.mark.parametrize("task", ["PickPlaceCounterToSink", "TurnOnStove"])
def test_one_kitchen_is_solved_in_many_ways(task: str) -> None:
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    plain, varied = record_episode(env, 3), record_episode(env, 3, varied=True)
    again = record_episode(env, 3, varied=True)
    env.close()
    assert plain.ep_meta["motion_style"] == dataclasses.asdict(PLAIN)
    assert varied.ep_meta["motion_style"] == dataclasses.asdict(MotionStyle.draw(np.random.default_rng([3, 6])))
    assert np.array_equal(varied.actions, again.actions)
    assert np.array_equal(plain.states[0], varied.states[0])
    length = min(len(plain.actions), len(varied.actions))
    assert np.abs(plain.actions[:length] - varied.actions[:length]).max() > 0.1
    assert plain.success
    assert varied.success
