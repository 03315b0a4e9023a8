"""How the robot answers steady commands, against what was measured on RoboCasa's: within 5 % or its own rounding.

`MEASURED` values are RoboCasa's table. A few of its entries are rounder than that; robosuite's own recordings
(`test_golden_traces.py`) then agree with us, and the test is called `test_known_...`.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, action, arena_spec

from robocasa_lerobot.envs.robots.panda_omron import names

FORWARD, SIDE, YAW = names.BASE_JOINTS
TORSO = names.TORSO_JOINT
FINGER = names.FINGER_JOINTS[0]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


def _within(value: float, measured: float, rounding: float) -> None:
    """Assert 5 % of the measured value, or half the last digit that it is given with."""
    assert value == pytest.approx(measured, abs=max(0.05 * abs(measured), rounding / 2))


# --- base ----------------------------------------------------------------------------------------------------------


def _base_speed(model: mujoco.MjModel, joint: str, command: float) -> float:
    """Mean speed over half a second, after one second."""
    base = {FORWARD: (command, 0.0, 0.0), SIDE: (0.0, command, 0.0), YAW: (0.0, 0.0, command)}[joint]
    arena = Arena.settled(model)
    arena.run(action(1.0, base=base), 20)
    start = arena.joint(joint)
    arena.run(action(1.0, base=base), 10)
    return (arena.joint(joint) - start) / 0.5


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("command", "measured"), [(0.5, 0.25), (0.75, 0.50), (1.0, 0.745)])
@pytest.mark.parametrize("joint", [FORWARD, SIDE])
def test_base_speed(model: mujoco.MjModel, joint: str, command: float, measured: float, sign: float) -> None:
    """The command less 0.25 m/s, which the friction in the joints takes."""
    _within(_base_speed(model, joint, sign * command), sign * measured, 0.01 if command < 1.0 else 0.001)


@pytest.mark.parametrize(("joint", "creep"), [(FORWARD, 0.0051), (SIDE, 0.0094)])
def test_base_creeps_at_the_edge_of_its_dead_zone(model: mujoco.MjModel, joint: str, creep: float) -> None:
    """At 0.25 the measured law leaves nothing; to its two digits that is so, and the creep is the recording's."""
    for sign in (1.0, -1.0):
        assert _base_speed(model, joint, sign * 0.25) == pytest.approx(sign * creep, abs=1e-4)
    assert abs(_base_speed(model, joint, 0.2)) < 0.008


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("command", "measured"), [(0.25, 0.21), (0.5, 0.58), (0.75, 0.958), (1.0, 1.325)])
def test_yaw_rate(model: mujoco.MjModel, command: float, measured: float, sign: float) -> None:
    """1.5 times the command, less 0.167 rad/s (0.958 at 0.75 is this line)."""
    _within(_base_speed(model, YAW, sign * command), sign * measured, 0.01 if command < 1.0 else 0.001)


def test_yaw_creeps_in_the_dead_zone(model: mujoco.MjModel) -> None:
    """Below 0.11 some 0.04 to 0.07 rad/s are left, read as the rates at half of it and just below it."""
    _within(_base_speed(model, YAW, 0.055), 0.04, 0.01)
    _within(_base_speed(model, YAW, 0.10), 0.07, 0.01)


# --- torso and gripper ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("command", "measured", "rounding"), [(0.3, 0.027, 0.001), (0.5, 0.15, 0.01)])
def test_torso_speed(model: mujoco.MjModel, command: float, measured: float, rounding: float) -> None:
    arena = Arena.settled(model)
    arena.run(action(torso=command), 20)
    _within(arena.joint(TORSO) / 1.0, measured, rounding)


def test_torso_goes_its_whole_way_within_a_second_and_then_holds(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model)
    arena.run(action(torso=1.0), 20)
    _within(arena.joint(TORSO), 0.34, 0.01)
    arena.run(action(), 5)
    height = arena.joint(TORSO)
    arena.run(action(), 40)
    assert arena.joint(TORSO) == pytest.approx(height, abs=1e-4)


def test_idle_torso_holds_half_way(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model)
    arena.run(action(torso=0.5), 20)
    arena.run(action(), 5)
    height = arena.joint(TORSO)
    arena.run(action(), 100)
    assert 0.1 < height < 0.2
    assert arena.joint(TORSO) == pytest.approx(height, abs=1e-4)


def _steps_until(arena: Arena, command: float, done: float) -> int:
    """Steps of a gripper command until the finger has passed `done` metres in its direction."""
    for step in range(1, 60):
        arena.run(action(gripper=command))
        if (arena.joint(FINGER) - done) * command < 0.0:
            return step
    raise AssertionError(f"the finger never passed {done} m")


def test_known_disagreement_steps_of_the_gripper(model: mujoco.MjModel) -> None:
    """Measured: closed to 2 mm in about 8 steps, open to 39 mm in about 17. Ours and the recording: 9 and 19.

    The finger creeps up to both marks (2.02 mm after 8 steps; 38.8 mm after 16), so a threshold that is read a little
    off shifts the count.
    """
    arena = Arena.settled(model)
    assert _steps_until(arena, 1.0, 0.0021) == 8
    arena = Arena.settled(model)
    assert _steps_until(arena, 1.0, 0.002) == 9
    arena.run(action(gripper=1.0), 10)
    opened = Arena(arena.model, arena.data, arena.controller)
    assert _steps_until(opened, -1.0, 0.039) == 19
    arena = Arena.settled(model)
    arena.run(action(gripper=1.0), 20)
    arena.run(action(gripper=-1.0), 17)
    assert arena.joint(FINGER) == pytest.approx(0.039, abs=0.0005)


# --- arm -----------------------------------------------------------------------------------------------------------


def _displacement(model: mujoco.MjModel, mode: float, position: tuple[float, float, float], steps: int) -> np.ndarray:
    """Where the grip site is in the base frame after each step (steps + 1, 3), relative to the start."""
    arena = Arena.settled(model)
    rows = [arena.state()[7:10]]
    for _ in range(steps):
        arena.run(action(mode, position=position))
        rows.append(arena.state()[7:10])
    return np.array(rows) - rows[0]


def test_arm_in_mode_minus_one_follows_26_percent(model: mujoco.MjModel) -> None:
    moved = _displacement(model, -1.0, (1.0, 0, 0), 20)[:, 0]
    _within(moved[10], 0.116, 0.001)
    steady = (moved[20] - moved[10]) / 10
    _within(steady, 0.013, 0.001)  # m per step
    _within(steady / 0.05, 0.26, 0.01)  # of the command
    _within(steady * 20, 0.26, 0.01)  # m/s
    _within(_displacement(model, -1.0, (0, 0, -1.0), 20)[-1, 2], -0.244, 0.001)


@pytest.mark.parametrize("size", [0.2, -0.5, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_share_does_not_depend_on_the_command(model: mujoco.MjModel, axis: int, size: float) -> None:
    position = [0.0, 0.0, 0.0]
    position[axis] = size
    moved = _displacement(model, -1.0, (position[0], position[1], 0.0), 20)[:, axis]
    _within((moved[20] - moved[10]) / 10 / (0.05 * size), 0.26, 0.01)


def test_arm_in_mode_plus_one_follows_all(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model)
    start = arena.state()[7]
    moved = [0.0]
    for _ in range(10):
        arena.run(action(1.0, position=(1.0, 0, 0)))
        moved.append(arena.state()[7] - start)
    _within(moved[10], 0.34, 0.01)
    _within(max(np.diff(moved)), 0.05, 0.01)  # m per step, once the lag is made up
    arena.run(action(1.0), 15)
    _within(arena.state()[7] - start, 0.50, 0.01)


def _turned(model: mujoco.MjModel, mode: float, rotation: tuple[float, float, float]) -> float:
    """Angle about the commanded axis after ten steps, rad."""
    arena = Arena.settled(model)
    before = arena.data.site(names.GRIP_SITE).xmat.reshape(3, 3).copy()
    arena.run(action(mode, rotation=rotation), 10)
    quat, vector = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quat, (arena.data.site(names.GRIP_SITE).xmat.reshape(3, 3) @ before.T).ravel())
    mujoco.mju_quat2Vel(vector, quat, 1.0)
    return float(vector @ rotation / np.linalg.norm(rotation))


# Of the measured table it is only known that they were ten steps; they are rotations about z in mode -1.
@pytest.mark.parametrize(("size", "measured"), [(0.5, 0.47), (1.0, 0.63)])
def test_arm_rotation(model: mujoco.MjModel, size: float, measured: float) -> None:
    _within(_turned(model, -1.0, (0, 0, size)), measured, 0.01)
    _within(_turned(model, -1.0, (0, 0, -size)), measured, 0.01)


@pytest.mark.parametrize(
    ("axis", "size", "angle"),
    [(0, 0.5, 0.526), (0, 1.0, 0.927), (0, -1.0, 0.928), (1, 0.5, 0.438), (1, 1.0, 0.643), (1, -1.0, 0.503)],
)
def test_known_disagreement_other_axes_turn_otherwise(
    model: mujoco.MjModel, axis: int, size: float, angle: float
) -> None:
    """The table gives one number for all axes; ours are those of robosuite's recordings, axis by axis."""
    rotation = [0.0, 0.0, 0.0]
    rotation[axis] = size
    assert _turned(model, -1.0, (rotation[0], rotation[1], rotation[2])) == pytest.approx(angle, abs=2e-3)


# --- arm and base together -----------------------------------------------------------------------------------------


def _excursion(model: mujoco.MjModel, steps: int, after: int, command: np.ndarray) -> np.ndarray:
    """Distance of the end effector from its start in the base frame, per step: `steps` of a command, then none."""
    arena = Arena.settled(model)
    start, rows = arena.state()[7:10], []
    for step in range(steps + after):
        arena.run(command if step < steps else action(command[11]))
        rows.append(np.linalg.norm(arena.state()[7:10] - start))
    return np.array(rows)


def test_arm_stays_behind_in_mode_minus_one_while_the_base_turns(model: mujoco.MjModel) -> None:
    _within(_excursion(model, 40, 0, action(-1.0, base=(0, 0, 1.0)))[-1], 0.46, 0.01)


@pytest.mark.parametrize("size", [1.0, -1.0])
def test_known_disagreement_arm_rides_along_within_54_mm(model: mujoco.MjModel, size: float) -> None:
    """Measured "within 5 cm"; ours and the recording trail by 54.2 mm at full speed, and by nothing afterwards."""
    lag = _excursion(model, 40, 20, action(1.0, base=(0, 0, size)))
    assert lag.max() == pytest.approx(0.0542, abs=3e-4)
    assert round(lag.max(), 2) == 0.05
    assert lag[-1] < 1e-3
    assert _excursion(model, 40, 0, action(1.0, base=(0, 0, 0.5 * size))).max() < 0.05


@pytest.mark.parametrize("mode", [-1.0, 1.0])
def test_zero_action_for_ten_seconds_does_not_drift(model: mujoco.MjModel, mode: float) -> None:
    arena = Arena.settled(model)
    start, pose = arena.data.qpos.copy(), arena.state()
    arena.run(action(mode), 200)
    np.testing.assert_allclose(arena.state()[:14], pose[:14], atol=1e-6)
    np.testing.assert_allclose(arena.data.qpos[:11], start[:11], atol=1e-6)
    # The fingers alone move: from 20.83 mm to the 20 mm of their half-open command.
    np.testing.assert_allclose(arena.data.qpos[11:], [0.02, -0.02], atol=1e-4)


@pytest.mark.parametrize("mode", [-1.0, 1.0])
@pytest.mark.parametrize("command", [0.3, 0.5, 1.0])
def test_torso_motion_leaves_the_arm_within_5_mm(model: mujoco.MjModel, command: float, mode: float) -> None:
    drift = _excursion(model, 20, 20, action(mode, torso=command))
    assert drift[-1] < 0.005
    if command < 1.0:
        assert drift.max() < 0.005


@pytest.mark.parametrize(("mode", "peak"), [(-1.0, 0.0099), (1.0, 0.0054)])
def test_known_disagreement_peak_while_the_torso_moves_at_full_speed(
    model: mujoco.MjModel, mode: float, peak: float
) -> None:
    """Measured "at most 5 mm", which holds once it stands; on the way the recording and ours have 10 mm in mode -1."""
    assert _excursion(model, 20, 20, action(mode, torso=1.0)).max() == pytest.approx(peak, abs=2e-4)
