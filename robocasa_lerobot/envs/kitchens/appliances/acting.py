"""The appliances of a scene, acting by themselves once per control step; nobody is asked who would do nothing again."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Touches, take_effect
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture

# Entries in qpos of a joint; one of all others.
_POSITIONS = {int(mujoco.mjtJoint.mjJNT_FREE): 7, int(mujoco.mjtJoint.mjJNT_BALL): 4}


class ActingAppliances:
    """The appliances among fixtures, in a compiled model.

    What they do follows from where their joints are, what touches their bodies, and the kitchen's memory and catches
    alone (`Appliance.react`). While these are the same as in a step in which nothing was done, nothing is done again.
    """

    def __init__(self, fixtures: Iterable[Fixture], model: mujoco.MjModel) -> None:
        self._appliances = [fixture for fixture in fixtures if isinstance(fixture, Appliance)]
        self._model = model
        names = tuple(appliance.name for appliance in self._appliances)
        bodies = [body for body in range(model.nbody) if model.body(body).name.startswith(names)]
        self._bodies = frozenset(bodies)
        joints = np.flatnonzero(np.isin(model.jnt_bodyid, bodies))
        ranges = [model.jnt_qposadr[j] + np.arange(_POSITIONS.get(int(model.jnt_type[j]), 1)) for j in joints]
        self._qpos = np.concatenate(ranges) if ranges else np.zeros(0, dtype=np.intp)
        self._idle: tuple[bytes, bytes, bytes, frozenset[int]] | None = None  # seen when nothing was done

    def act(self, data: mujoco.MjData, gripper: NDArray[np.bool_]) -> None:
        """Let them latch, time and light up.

        Before and after: positions and contacts are evaluated. `gripper` are the bodies that press buttons, (nbody,).
        """
        if not self._appliances:
            return
        contacts = Touches(self._model, data, gripper)
        seen = self._seen(data, contacts)
        if seen == self._idle:
            return
        changed = [appliance.update(self._model, data, contacts) for appliance in self._appliances]
        if any(changed):
            take_effect(self._model, data)
        self._idle = seen if not any(changed) and self._seen(data, contacts) == seen else None

    def _seen(self, data: mujoco.MjData, contacts: Touches) -> tuple[bytes, bytes, bytes, frozenset[int]]:
        """All that they may look at."""
        touched = contacts.bodies & self._bodies
        return data.qpos[self._qpos].tobytes(), data.userdata.tobytes(), data.eq_active.tobytes(), touched
