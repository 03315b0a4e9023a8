"""One control step: an action held over 25 physics steps."""

from __future__ import annotations

import mujoco
from numpy.typing import ArrayLike

from robocasa_lerobot.contract import SUBSTEPS
from robocasa_lerobot.envs.physics.whole_state import read_physics, write_physics
from robocasa_lerobot.envs.robots.robot import Controller

_BAD = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]


class DivergedError(RuntimeError):
    """The physics has left the numbers that it can compute with: a state is not finite, or absurdly large."""


def control_step(
    model: mujoco.MjModel, data: mujoco.MjData, controller: Controller, action: ArrayLike, substeps: int = SUBSTEPS
) -> None:
    """Advance the simulation by one policy step (50 ms) with `action` (12,) in HDF5 order.

    Before: positions and velocities are evaluated (`mj_forward`, or an earlier control step). After: they are again,
    so that poses, contacts and pictures belong to the state reached, not to one physics step before it.

    Raises:
        ContractError: the action has another shape or is not finite.
        DivergedError: the simulation is lost; the data must be reset.
    """
    controller.set_action(action)
    stale = controller.run(substeps)
    if data.warning.number[_BAD].any():
        raise DivergedError(f"the simulation diverged at {data.time:.3f} s; reset the env.")
    if stale:
        # MuJoCo uses what it had evaluated for a sleeping tree when the tree wakes. Evaluated anew, that follows from
        # the state alone, so that a restored state goes on bit for bit as the first run did.
        write_physics(model, data, *read_physics(model, data))
