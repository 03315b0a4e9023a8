"""What reaches into what, and what the robot touches: where everything was put, or where it came to rest."""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.scene.scene import Scene

SUNK_M = 0.006  # that resting things may reach into each other; food on a plate settles by a tenth of a millimetre


def ask_for_room(scene: Scene) -> None:
    """Look at a built scene as it was put together, for what no plan of footprints shows: handles, doors, walls.

    What reaches into something where it starts is pressed out of it, or through it; a robot that touches something
    cannot move freely. It is looked at before anything settles: one evaluation of positions, a hundredth of the build.

    Raises:
        PlacementError: an object reaches too deep into anything, or the robot touches something.
    """
    data = scene.evaluated_start()
    objects = scene.subtree(*scene.objects) if scene.objects else np.zeros(scene.model.nbody, dtype=bool)
    for one, other, depth in _deeper(scene.model, data, SUNK_M):
        if objects[scene.model.body(one).id] or objects[scene.model.body(other).id]:
            raise PlacementError(f"{one} reaches {depth:.3f} m into {other}")
    if touched := scene.robot_touches(data):
        raise PlacementError(f"the robot touches {', '.join(touched)}")


def sunk_in(model: mujoco.MjModel, data: mujoco.MjData, deeper_m: float = SUNK_M) -> list[tuple[str, str, float]]:
    """Pairs of bodies in contact deeper than allowed, with the depth in metres, the deepest first.

    What sleeps has no contacts in `data`: they are looked for anew from its positions, which stay as they are.
    """
    return _deeper(model, _awake(model, data), deeper_m)


def _deeper(model: mujoco.MjModel, awake: mujoco.MjData, deeper_m: float) -> list[tuple[str, str, float]]:
    deepest: dict[tuple[str, str], float] = {}
    for geoms, distance in zip(awake.contact.geom, awake.contact.dist, strict=True):
        if distance < -deeper_m:
            one, other = (str(model.body(model.geom_bodyid[geom]).name) for geom in geoms)
            deepest[one, other] = max(deepest.get((one, other), 0.0), -float(distance))
    return sorted(((*pair, depth) for pair, depth in deepest.items()), key=lambda found: -found[2])


def robot_touches(scene: Scene, data: mujoco.MjData) -> list[str]:
    """Names of the bodies that the robot touches: where an episode begins, it stands free."""
    return scene.robot_touches(_awake(scene.model, data))


def _awake(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """A state of its own at the same positions, in which nothing sleeps and contacts are there."""
    awake = mujoco.MjData(model)
    awake.qpos[:], awake.mocap_pos[:], awake.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
    mujoco.mj_fwdPosition(model, awake)
    return awake
