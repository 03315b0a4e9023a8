"""Where the geoms of a model are drawn: those that never move in the world's frame, the others in their body's."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.quaternions import matrices

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RestPoses:
    """Poses of all geoms of a model.

    Attributes:
        fixed: whether a geom never moves, (ngeom,).
        positions, rotations: (ngeom, 3) and (ngeom, 3, 3).
        quats: wxyz, (ngeom, 4).
    """

    fixed: NDArray[np.bool_]
    positions: Array
    rotations: Array
    quats: Array

    @classmethod
    def of(cls, model: mujoco.MjModel) -> RestPoses:
        """Of all geoms of a model."""
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        fixed = (model.body_weldid == 0) & (model.body_mocapid < 0)
        at_rest = fixed[model.geom_bodyid]
        rotations = np.where(at_rest[:, None, None], data.geom_xmat.reshape(-1, 3, 3), matrices(model.geom_quat))
        positions = np.where(at_rest[:, None], data.geom_xpos, model.geom_pos)
        quats = model.geom_quat.copy()
        matrix_of = data.geom_xmat
        for geom in np.flatnonzero(at_rest).tolist():
            mujoco.mju_mat2Quat(quats[geom], matrix_of[geom])
        return cls(at_rest, positions, rotations, quats)
