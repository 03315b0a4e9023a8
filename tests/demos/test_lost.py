"""What has left the hand is noticed at once, and what lies on the floor is given up; what hangs from it stays in it."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos import stages as stages_module
from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    Array,
    HandTarget,
    action,
    base_pose,
    floor_axes,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.planning.errors import LostError, SlippedError
from robocasa_lerobot.demos.skills.pick_place.carrying import letting_go
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import on_floor, require_off_floor, unless_lost
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.verbs import place_object
from robocasa_lerobot.demos.stages import StageLog, carry_out
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

LYING_M = 0.05  # of an origin over the floor
BEHIND_M = 0.7  # the base's centre


@pytest.fixture
def env() -> Iterator[KitchenEnv]:
    """A task that moves an object, at reset."""
    kitchen = KitchenEnv("PickPlaceCounterToSink", split="target", cameras=(), terminate_on_success=False)
    kitchen.reset(seed=0)
    yield kitchen
    kitchen.close()


def bring(env: KitchenEnv, point: Array) -> None:
    """Put the object at a point."""
    joint = int(env.model.body("obj").jntadr[0])
    address, dof = int(env.model.jnt_qposadr[joint]), int(env.model.jnt_dofadr[joint])
    env.data.qpos[address : address + 3] = point
    env.data.qvel[dof : dof + 6] = 0.0
    mujoco.mj_forward(env.model, env.data)


def to_floor(env: KitchenEnv) -> None:
    """Put the object on the floor, behind the robot."""
    base, yaw = base_pose(env.data)
    behind = base - BEHIND_M * floor_axes(yaw)[0]
    bring(env, np.array([behind[0], behind[1], LYING_M]))


def run[T](env: KitchenEnv, move: Generator[Array, None, T], fingers: list[float]) -> T:
    """Do a move in the kitchen, and note the commands for the fingers; what it returns."""
    while True:
        try:
            step = next(move)
        except StopIteration as stop:
            value: T = stop.value
            return value
        fingers.append(float(step[-1]))
        env.step(step)


def test_what_stands_on_a_counter_is_not_lost(env: KitchenEnv) -> None:
    obj = graspable(env, "obj")
    assert not on_floor(env, obj)
    require_off_floor(env, obj)


def test_what_lies_on_the_floor_is_given_up_without_planning(env: KitchenEnv) -> None:
    to_floor(env)
    assert on_floor(env, graspable(env, "obj"))
    with pytest.raises(LostError, match="fell to the floor"):
        list(place_object(env, Stage("pick_place", "place", "sink", object="obj")))


def test_an_episode_ends_with_the_first_attempt_at_what_is_lost(env: KitchenEnv) -> None:
    to_floor(env)
    log = StageLog()
    with pytest.raises(LostError, match="fell to the floor"):
        list(carry_out(env, log))
    assert log.outcomes[0].attempts == 1 < stages_module.ATTEMPTS
    assert "fell to the floor" in log.outcomes[0].reason


def test_a_move_ends_in_the_step_in_which_the_object_has_left_the_hand(env: KitchenEnv) -> None:
    far = env.data.body("obj").xpos + np.array([0.0, 0.0, 0.5])
    obj = graspable(env, "obj")

    def still() -> Iterator[Array]:
        for _ in range(10):
            yield action(gripper=CLOSED)

    assert len(list(unless_lost(env, obj, still()))) == 10
    move = unless_lost(env, obj, still())
    for _ in range(3):
        next(move)
    bring(env, far)
    with pytest.raises(SlippedError, match="slipped out of the hand"):
        next(move)


@pytest.mark.parametrize("hung_steps", [0, 5, 10_000])
def test_the_open_hand_goes_down_only_while_something_hangs_from_it(
    env: KitchenEnv, monkeypatch: pytest.MonkeyPatch, hung_steps: int
) -> None:
    start, fingers = float(grip_position(env.data)[2]), list[float]()
    monkeypatch.setattr(letting_go, "hangs", lambda *_: len(fingers) < hung_steps)
    down = run(env, letting_go.set_down(env, graspable(env, "obj")), fingers)
    assert (down > 0) == (hung_steps > 0)
    assert down <= letting_go.MOST_DOWN_M + 1e-9
    assert start - grip_position(env.data)[2] == pytest.approx(down, abs=0.02)
    assert all(command == OPEN for command in fingers)


@pytest.mark.parametrize("hanging", [False, True])
def test_a_hand_that_something_keeps_hanging_from_closes_again(
    env: KitchenEnv, monkeypatch: pytest.MonkeyPatch, hanging: bool
) -> None:
    at, fingers = HandTarget(grip_position(env.data), hand_rotation(env.data)), list[float]()
    monkeypatch.setattr(letting_go, "hangs", lambda *_: hanging)
    assert run(env, letting_go.caught(env, graspable(env, "obj"), at, at), fingers) is hanging
    assert fingers[-1:] == ([CLOSED] if hanging else [])
