"""The whole robot's controller: a 12-D action per policy step, actuator commands per physics step."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robocasa_lerobot.contract import ACTION_SIZE, SUBSTEPS, ContractError
from robocasa_lerobot.envs.physics import native
from robocasa_lerobot.envs.physics.nearby import Nearby
from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.control import indices, kernel
from robocasa_lerobot.errors import UserError


class PandaOmronController:
    """Arm, base, torso and gripper together; all four always execute what they are told.

    The control mode only chooses what an arm command is added to: its previous goal (> 0), so that the arm rides
    with a driving base, or the pose it has reached (<= 0). After a reset the goal is the pose of the reset.

    The controller's memory (goals, posture, targets, the base pose of the last physics step) is one vector, which
    `get_state` and `set_state` copy: with it and MuJoCo's integration state a simulation continues bit for bit.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        native.load()
        self._model, self._data = model, data  # the compiled code holds their addresses
        self._memory = np.zeros(kernel.MEMORY_SIZE)
        self._places = _places(model)
        self._nearby = Nearby(model, data)
        self._views = kernel.Views(
            qpos=data.qpos,
            qvel=data.qvel,
            ctrl=data.ctrl,
            mass=data.M,
            bias=data.qfrc_bias,
            site_xpos=data.site_xpos,
            site_xmat=data.site_xmat,
            xaxis=data.xaxis,
            xanchor=data.xanchor,
            cvel=data.cvel,
            subtree_com=data.subtree_com,
            tree_asleep=data.tree_asleep,
        )

    def reset(self) -> None:
        """Forget all goals and hold the present pose; the data must be up to date (`mj_forward`)."""
        kernel.reset(self._memory, self._views, self._places)

    def set_action(self, action: ArrayLike) -> None:
        """Take the action (12,) of a policy step, in HDF5 order; it is clipped to +-1.

        The data must be up to date in positions (after `mj_forward` or `mj_step1`).

        Raises:
            ContractError: the action has another shape or is not finite.
        """
        command = np.asarray(action, dtype=np.float64)
        if command.shape != (ACTION_SIZE,):
            raise ContractError(f"action: found shape {command.shape}, expected ({ACTION_SIZE},).")
        if not np.isfinite(command).all():
            raise ContractError(f"action: found {command}, expected finite numbers.")
        kernel.command(self._memory, self._views, self._places, command)

    def apply(self) -> None:
        """Write `data.ctrl` for the next physics step (between `mj_step1` and `mj_step2`)."""
        kernel.apply(self._memory, self._views, self._places)

    def run(self, substeps: int = SUBSTEPS) -> bool:
        """Control and advance the simulation by `substeps` physics steps, in one compiled call.

        Before and after: positions and velocities are evaluated (`mj_forward`, `mj_step1`). Returns whether what
        sleeps must be evaluated anew (`physics.write_physics`).
        """
        memory, views, places, watch = self._memory, self._views, self._places, self._nearby.watch
        model, data = self._model._address, self._data._address
        stale = False
        try:
            while True:
                self._nearby.leave_out()
                made, now = kernel.run(memory, views, places, watch, model, data, substeps)
                stale, substeps = stale or now, substeps - made
                if substeps == 0:
                    return stale
        finally:
            # Ctrl-C between the two calls would leave the masks zero, and the next step take them for the model's own.
            self._nearby.look_at_all()

    def goal_in_base(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Goal position (3,) metres and rotation matrix (3, 3) of the grip site in the arm's base frame."""
        return self._memory[kernel.GOAL_POS].copy(), self._memory[kernel.GOAL_MAT].reshape(3, 3).copy()

    def arm_frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position (3,) metres and axes (3, 3) of the arm's base in the world that commands are taken relative to.

        They are those of the last physics step, which a driving base has just left.
        """
        return self._memory[kernel.BASE_POS].copy(), self._memory[kernel.BASE_MAT].reshape(3, 3).copy()

    def get_state(self) -> NDArray[np.float64]:
        """A copy of the controller's memory, shape (37,)."""
        return self._memory.copy()

    def set_state(self, state: ArrayLike) -> None:
        """Restore what `get_state` returned.

        Raises:
            UserError: the state has another shape.
        """
        values = np.asarray(state, dtype=np.float64)
        if values.shape != self._memory.shape:
            raise UserError(f"controller state: found shape {values.shape}, expected {self._memory.shape}.")
        self._memory[:] = values


def _places(model: mujoco.MjModel) -> kernel.Places:
    sites = [model.site(name).id for name in (names.GRIP_SITE, names.ARM_CENTER_SITE)]
    bodies = [int(model.site_bodyid[site]) for site in sites]
    arm_qvel = indices.joint_velocities(model, names.ARM_JOINTS)
    torso_qvel = indices.joint_velocities(model, (names.TORSO_JOINT,))
    fingers = indices.actuators(model, names.FINGER_ACTUATORS)
    limits = model.actuator_ctrlrange[fingers]
    actuators = (*names.ARM_ACTUATORS, *names.BASE_ACTUATORS, names.TORSO_ACTUATOR, *names.FINGER_ACTUATORS)
    return kernel.Places(
        sites=np.array(sites, dtype=np.int64),
        site_bodies=np.array(bodies, dtype=np.int64),
        root=int(model.body_rootid[bodies[0]]),
        arm_joints=np.array([model.joint(name).id for name in names.ARM_JOINTS], dtype=np.int64),
        arm_qpos=indices.joint_positions(model, names.ARM_JOINTS),
        arm_qvel=arm_qvel,
        arm_mass=indices.mass_matrix_addresses(model, arm_qvel),
        base_yaw=int(indices.joint_positions(model, names.BASE_JOINTS[2:])[0]),
        torso=np.array(
            [
                indices.joint_positions(model, (names.TORSO_JOINT,))[0],
                torso_qvel[0],
                indices.mass_matrix_addresses(model, torso_qvel)[0, 0],
            ],
            dtype=np.int64,
        ),
        actuators=indices.actuators(model, actuators),
        tree_roots=model.body_rootid[model.tree_bodyadr].astype(np.int64),
        finger_middle=limits.mean(axis=1),
        finger_half=0.5 * (limits[:, 1] - limits[:, 0]),
    )
