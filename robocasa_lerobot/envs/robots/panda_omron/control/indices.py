"""Where joints and actuators lie in MuJoCo's arrays."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray


def joint_positions(model: mujoco.MjModel, joints: Sequence[str]) -> NDArray[np.intp]:
    """Indices into qpos of slide and hinge joints."""
    return np.array([model.joint(name).qposadr[0] for name in joints], dtype=np.intp)


def joint_velocities(model: mujoco.MjModel, joints: Sequence[str]) -> NDArray[np.intp]:
    """Indices into qvel of slide and hinge joints."""
    return np.array([model.joint(name).dofadr[0] for name in joints], dtype=np.intp)


def actuators(model: mujoco.MjModel, names: Sequence[str]) -> NDArray[np.intp]:
    """Indices into ctrl."""
    return np.array([model.actuator(name).id for name in names], dtype=np.intp)


def mass_matrix_addresses(model: mujoco.MjModel, dofs: NDArray[np.intp]) -> NDArray[np.intp]:
    """Indices into `data.M` of the mass matrix block of `dofs`, shape (n, n).

    `data.M` holds the lower triangle in rows; the dofs must form a chain, each an ancestor of the next, so that
    every element of the block is stored.
    """
    addresses = np.empty((dofs.size, dofs.size), dtype=np.intp)
    for i, row in enumerate(dofs):
        start = model.M_rowadr[row]
        columns = model.M_colind[start : start + model.M_rownnz[row]]
        for j, column in enumerate(dofs[: i + 1]):
            found = np.flatnonzero(columns == column)
            assert found.size == 1, f"dofs {row} and {column} are not on one chain"
            addresses[i, j] = addresses[j, i] = start + found[0]
    return addresses
