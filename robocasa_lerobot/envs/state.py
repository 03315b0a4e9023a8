"""The whole state of a running episode: enough to go on from it bit for bit, in this process or another."""

from __future__ import annotations

from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.whole_state import physics_size, write_physics
from robocasa_lerobot.envs.robots.robot import Controller
from robocasa_lerobot.errors import UserError


@dataclass(frozen=True)
class KitchenState:
    """A state of a `KitchenEnv`; on the same machine and MuJoCo version it continues bit for bit.

    Attributes:
        task, split, seed: the scene, which is a function of them and of the kitchens that the env chooses from.
        steps: control steps since the reset.
        physics: MuJoCo's integration state (time, qpos, qvel, controls, applied forces, solver warm start).
        asleep: which trees of bodies sleep (int32), as MuJoCo encodes it.
        controller: goals and targets of the robot's controllers.
        mujoco_version: that the state is of.
        layout_id, style_id: the kitchen that was chosen; None in a state that was stored without it.
    """

    task: str
    split: str
    seed: int
    steps: int
    physics: NDArray[np.float64]
    asleep: NDArray[np.int32]
    controller: NDArray[np.float64]
    mujoco_version: str
    layout_id: int | None = None
    style_id: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values and arrays, for `numpy.savez` or a message to another process."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> KitchenState:
        """Read what `to_dict` gave, or an `.npz` file of it.

        Raises:
            UserError: a part is missing.
        """
        needed = [field.name for field in fields(cls) if field.default is MISSING]
        missing = [name for name in needed if name not in values]
        if missing:
            raise UserError(f"kitchen state: {', '.join(missing)} missing; found {', '.join(values) or 'nothing'}.")
        return cls(
            task=str(values["task"]),
            split=str(values["split"]),
            seed=int(values["seed"]),
            steps=int(values["steps"]),
            physics=np.asarray(values["physics"], dtype=np.float64),
            asleep=np.asarray(values["asleep"], dtype=np.int32),
            controller=np.asarray(values["controller"], dtype=np.float64),
            mujoco_version=str(values["mujoco_version"]),
            layout_id=int(values["layout_id"]) if "layout_id" in values else None,
            style_id=int(values["style_id"]) if "style_id" in values else None,
        )


def check_kind(state: Any) -> None:
    """Check that something is a state, and not what one was stored as.

    Raises:
        UserError: it is something else.
    """
    if not isinstance(state, KitchenState):
        raise UserError(
            f"kitchen state: found a {type(state).__name__}, expected what `get_state` gave; "
            "`KitchenState.from_dict` makes one of what `to_dict` stored."
        )


def check_fits(model: mujoco.MjModel, state: KitchenState) -> None:
    """Check that a state has as many numbers as a model.

    Raises:
        UserError: it is of another one.
    """
    size = physics_size(model)
    if state.physics.shape != (size,) or state.asleep.shape != (model.ntree,):
        raise UserError(
            f"kitchen state: {state.physics.size} numbers and {state.asleep.size} trees do not fit this scene "
            f"({size} and {model.ntree}); it was made by another version of the kitchens."
        )


def restore(model: mujoco.MjModel, data: mujoco.MjData, controller: Controller, state: KitchenState) -> None:
    """Put `data` and `controller` into `state`, positions and velocities evaluated.

    Raises:
        UserError: the state is of another model.
    """
    check_fits(model, state)
    write_physics(model, data, state.physics, state.asleep)
    controller.set_state(state.controller)
