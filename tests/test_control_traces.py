"""The robot's answers to recorded action sequences against those of robosuite."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest
from robot_arena import SHARED, Arena, action, arena_spec

from robocasa_lerobot.envs.scene import robot_names as names

FORWARD, SIDE, YAW = names.BASE_JOINTS


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


# Position of one joint after some steps of a trace (m, rad), kept here so that the comparison also runs where the
# recordings are not: (trace, its action, steps, joint, position).
GOLDEN = [
    ("static", action(), 100, "robot0_joint4", -2.27551),
    ("base_forward_+1.00", action(1.0, base=(1, 0, 0)), 10, FORWARD, 0.32115),
    ("base_left_+1.00", action(1.0, base=(0, 1, 0)), 10, SIDE, 0.32104),
    ("base_yaw_+1.00", action(1.0, base=(0, 0, 1)), 10, YAW, 0.65759),
    ("torso_+0.5", action(torso=0.5), 10, names.TORSO_JOINT, 0.07527),
    ("arm_x+1_mode-1", action(-1.0, position=(1, 0, 0)), 10, "robot0_joint2", -0.75266),
    ("arm_x+1_mode+1", action(1.0, position=(1, 0, 0)), 10, "robot0_joint2", -0.13476),
    ("gripper_close_open", action(gripper=1.0), 10, names.FINGER_JOINTS[0], 0.00134),
]


@pytest.mark.parametrize(("name", "command", "steps", "joint", "value"), GOLDEN, ids=[g[0] for g in GOLDEN])
def test_joint_positions_recorded_from_robosuite(
    model: mujoco.MjModel, name: str, command: np.ndarray, steps: int, joint: str, value: float
) -> None:
    arena = Arena.settled(model)
    offset = arena.joint(joint) if joint in (FORWARD, SIDE) else 0.0
    arena.run(command, steps)
    assert arena.joint(joint) - offset == pytest.approx(value, abs=5e-5)


TRACES = SHARED / "real" / "robosuite_traces" / "panda_omron_traces.npz"
NEEDS_TRACES = pytest.mark.skipif(not TRACES.exists(), reason="the recorded traces are not here")
# 1.5.1 moves its "forward" joint for sideways commands: its first two joints are ours exchanged.
OUR_ORDER = [1, 0, *range(2, 13)]
# After some 105 steps this one drives the arm through singular poses with torques a thousandfold over their limits
# and amplifies a difference of 1e-7 rad tenfold in every few steps: it is compared up to there.
CHAOTIC_AFTER = {"arm_random_mode+1": 105}


@cache
def _traces() -> dict[str, np.ndarray]:
    with np.load(TRACES) as file:
        return {key: file[key] for key in file.files}


def _trace_names() -> list[str]:
    return [str(name) for name in _traces()["names"]] if TRACES.exists() else []


FAST_TRACES = ("arm_and_base_random", "base_yaw_-1.00", "torso_+1.0", "gripper_close_open", "arm_rx+1_mode+1")


@pytest.fixture(scope="module")
def single_contact_model() -> mujoco.MjModel:
    """The traces' arena finds one contact per pair of convex shapes, RoboCasa's kitchens several."""
    spec = arena_spec()
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)
    return spec.compile()


@NEEDS_TRACES
@pytest.mark.parametrize(
    "name", [n if n in FAST_TRACES else pytest.param(n, marks=pytest.mark.slow) for n in _trace_names()]
)
def test_replayed_traces_reach_the_recorded_joint_positions(single_contact_model: mujoco.MjModel, name: str) -> None:
    traces = _traces()
    actions, recorded = traces[f"{name}/actions"], traces[f"{name}/qpos"][:, OUR_ORDER]
    steps = CHAOTIC_AFTER.get(name, len(actions))
    arena = Arena.settled(single_contact_model)
    own = [arena.data.qpos.copy()]
    for command in actions[:steps]:
        arena.run(command)
        own.append(arena.data.qpos.copy())
    ours = np.array(own) + np.array([10.0, 10.0, *np.zeros(11)])
    error = np.abs(ours - recorded[: steps + 1])
    # Off yaw 0 the base command of robosuite 1.5.1 is turned the other way, and the arm feels it.
    base, arm = (5e-3, 2e-4) if name == "arm_and_base_random" else (5e-5, 5e-5)
    assert error[:, :3].max() < base  # m, rad
    assert error[:, 3:].max() < arm
