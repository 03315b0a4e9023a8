"""Whether what was piled up stays: vegetables heaped in a bowl may roll off each other, or out of it."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.scene.scene import Scene

_LET_DOWN_M = 0.001  # what starts higher above the floor of its vessel comes to rest where no plan says
# The bounds of the checks of soundness are 20 and 10 mm: what comes near them may pass them with more noise.
_FALL_M, _MOVED_M = 0.016, 0.005
_CALM_S, _WATCHED_S, _LOOK_S = 0.5, 1.5, 0.05  # settling of an episode; all that is watched; between two looks


def ask_for_rest(scene: Scene) -> None:
    """Let what was piled up settle, and refuse what falls, or moves on after the time that an episode's start takes.

    Only scenes in which something lies on what lies in a vessel are simulated, one in six, and until all objects sleep.

    Raises:
        PlacementError: an object falls, or does not come to rest.
    """
    if all(placed.let_down_m <= _LET_DOWN_M for placed in scene.objects.values()):
        return
    model, data = scene.model, scene.placed_data()
    mujoco.mj_forward(model, data)
    robot = scene.subtree(scene.robot.names.base)[model.dof_bodyid]
    data.qfrc_applied[robot] = data.qfrc_bias[robot]  # it hangs where it is
    trees = model.body_treeid[[model.body(name).id for name in scene.objects]]
    calm: dict[str, np.ndarray] = {}
    for look in range(1, round(_WATCHED_S / _LOOK_S) + 1):
        mujoco.mj_step(model, data, nstep=round(_LOOK_S / model.opt.timestep))
        if not calm and look * _LOOK_S >= _CALM_S - 1e-9:
            calm = {name: data.body(name).xpos.copy() for name in scene.objects}
            _refuse(fell(scene, data).items(), _FALL_M, "falls")
        if (data.tree_asleep[trees] >= 0).all():
            break
    _refuse(fell(scene, data).items(), _FALL_M, "falls")
    moved = [(name, float(np.linalg.norm(data.body(name).xpos - at))) for name, at in calm.items()]
    _refuse(moved, _MOVED_M, "does not come to rest, but moves")


def _refuse(found: Iterable[tuple[str, float]], allowed_m: float, what: str) -> None:
    for name, by in found:
        if by > allowed_m:
            raise PlacementError(f"{name} {what} by {by:.3f} m")


def fell(scene: Scene, data: mujoco.MjData) -> dict[str, float]:
    """Metres that each object has left the place where it was put down, along z; `data` is the episode's start.

    What is let down on what lies in a vessel, or on its rim, may come down to the vessel's floor.
    """
    rose = {name: float(data.body(name).xpos[2] - placed.pos[2]) for name, placed in scene.objects.items()}
    return {name: max(by, -by - scene.objects[name].let_down_m, 0.0) for name, by in rose.items()}
