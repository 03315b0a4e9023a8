"""MuJoCo's state with what sleeps: read, and written so that everything else follows from it."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics import native
from robocasa_lerobot.envs.physics.sleep import update_sleep

_SIGNATURE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


def physics_size(model: mujoco.MjModel) -> int:
    """Numbers in the integration state of a model."""
    return int(mujoco.mj_stateSize(model, _SIGNATURE))


def read_physics(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """MuJoCo's integration state (time, qpos, qvel, controls, forces, warm start), and which trees sleep (ntree,)."""
    physics = np.empty(physics_size(model))
    mujoco.mj_getState(model, data, physics, _SIGNATURE)
    return physics, data.tree_asleep.copy()


def write_physics(
    model: mujoco.MjModel, data: mujoco.MjData, physics: NDArray[np.float64], asleep: NDArray[np.int32]
) -> None:
    """Put `data` into a state, positions and velocities evaluated; nothing of what it held before remains."""
    native.load()
    mujoco.mj_resetData(model, data)
    mujoco.mj_setState(model, data, physics, _SIGNATURE)
    # Once with everything awake, since what sleeps is not evaluated; then with what slept asleep again, without
    # which drawers at rest would creep by their solver's last digits.
    mujoco.mj_forward(model, data)
    data.tree_asleep[:] = asleep
    update_sleep(model._address, data._address)
    mujoco.mj_step1(model, data)
