"""Preparing demonstrations of such an arm from their states and actions: `datagen_info` as MimicGen writes it."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.generate.fixed_arm.osc import ArmController
from robocasa_lerobot.demos.generate.mimicgen.subtasks import DatagenInfo
from robocasa_lerobot.demos.generate.sources.frames import body_pose
from robocasa_lerobot.demos.generate.sources.transform import target_of
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.errors import UnknownNameError, UserError

GRASP = "grasp"  # name of the signal: both fingers touch the first object
_PADS = ("gripper0_finger1", "gripper0_finger2")  # what geoms of either finger are called


def put_state(model: mujoco.MjModel, data: mujoco.MjData, state: Array) -> None:
    """Write a recorded state: time, positions, velocities.

    Raises:
        UserError: it is of another model.
    """
    if len(state) != 1 + model.nq + model.nv:
        raise UserError(f"a state has {len(state)} numbers, and the model of its file {1 + model.nq + model.nv}.")
    data.time, data.qpos[:], data.qvel[:] = state[0], state[1 : 1 + model.nq], state[1 + model.nq :]
    mujoco.mj_forward(model, data)


def datagen_of(
    number: int, name: str, model: mujoco.MjModel, states: Array, actions: Array, bodies: Sequence[str]
) -> DatagenInfo:
    """What generation needs to know of a demonstration.

    Args:
        number: among the sources.
        name: for messages.
        model: of its file.
        states: (T, 1 + nq + nv).
        actions: (T, 7), `OSC_POSE` deltas and the fingers' command.
        bodies: of the objects that subtasks are relative to; the signal `grasp` is about the first.

    Raises:
        UnknownNameError: the model has no such body.
        UserError: states of another model.
    """
    known = [model.body(body).name for body in range(model.nbody)]
    for body in bodies:
        if body not in known:
            raise UnknownNameError("body", body, known)
    data = mujoco.MjData(model)
    put_state(model, data, states[0])
    controller = ArmController(model, data)
    eef, target = np.empty((len(actions), 4, 4)), np.empty((len(actions), 4, 4))
    objects: dict[str, Array] = {body: np.empty((len(actions), 4, 4)) for body in bodies}
    grasped = np.zeros(len(actions), dtype=np.int64)
    for step, (state, action) in enumerate(zip(states, np.clip(actions, -1.0, 1.0), strict=True)):
        put_state(model, data, state)
        eef[step] = controller.hand()
        target[step] = target_of(action[:3], action[3:6], eef[step])
        for body, poses in objects.items():
            poses[step] = body_pose(data, model.body(body).id)
        grasped[step] = holds(model, data, bodies[0])
    return DatagenInfo(
        number, name, eef, target, actions[:, 6].astype(np.float64), objects, {GRASP: _from_last(grasped)}
    )


def holds(model: mujoco.MjModel, data: mujoco.MjData, body: str) -> bool:
    """Whether both fingers touch a body."""
    mine = model.body(body).id
    touched = set()
    for pair in data.contact.geom[: data.ncon].tolist():
        for geom, other in (pair, pair[::-1]):
            if model.geom_bodyid[other] == mine:
                touched |= {pad for pad in _PADS if model.geom(geom).name.startswith(pad)}
    return len(touched) == len(_PADS)


def _from_last(grasped: NDArray[np.int64]) -> NDArray[np.int64]:
    """0 until the grasp that lasts to the end begins, 1 from then on; as it is where there is none at the end."""
    free = np.flatnonzero(grasped == 0)
    if grasped[-1] == 0 or not len(free):
        return grasped
    return (np.arange(len(grasped)) > free[-1]).astype(np.int64)
