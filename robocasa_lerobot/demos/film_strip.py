"""Film strips: a whole demonstration at a glance, a row for each camera, time from left to right."""

from __future__ import annotations

import itertools
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import base_pose
from robocasa_lerobot.demos.replay import kitchen_of, read_demonstration
from robocasa_lerobot.demos.titled import titled
from robocasa_lerobot.envs.robots.panda_omron.names import GRIP_SITE
from robocasa_lerobot.files import written_aside

STRIP_PICTURES, STRIP_SIZE = 10, 224  # along the strip; pixels of each
# Of a camera that follows the hand: over a shoulder, or where nothing stands between.
_CLOSE_M, _SIDES_DEG, _DOWN_DEG = 0.9, (40.0, -40.0, 75.0, -75.0, 10.0), (-28.0, -50.0, -8.0)
_NEAR_HAND_M = 0.25  # geoms nearer to the hand than this belong to it


def film_strip(path: Path, demo: str, out: Path) -> None:
    """Write a PNG with the contract's cameras and one that follows the hand, from the first state to the last.

    Raises:
        UserError: the kitchen of the demonstration cannot be made again.
    """
    from robocasa_lerobot.envs.rendering import SceneRenderer
    from robocasa_lerobot.gl import ensure_drawing

    ensure_drawing()
    recorded = read_demonstration(path, demo)
    shown = np.linspace(0, len(recorded.states) - 1, STRIP_PICTURES).round().astype(int)
    env = kitchen_of(recorded)
    renderer = None
    try:
        env.reset(seed=recorded.seed)
        data = mujoco.MjData(env.model)
        renderer = SceneRenderer(env.model, STRIP_SIZE, STRIP_SIZE)
        columns = []
        for step in shown:
            show_state(env.model, data, recorded.states[step])
            pictures = [
                *renderer.pictures(data, contract.CAMERAS),
                renderer.render(data, beside_the_hand(env.model, data)),
            ]
            columns.append(titled(np.vstack(pictures), f"{step / contract.CONTROL_HZ:.1f} s"))
    finally:
        if renderer is not None:
            renderer.close()
        env.close()
    title = f"{recorded.task}, {recorded.split}, seed {recorded.seed}: {recorded.instruction}"
    out.parent.mkdir(parents=True, exist_ok=True)
    with written_aside(out) as aside:
        Image.fromarray(titled(np.hstack(columns), title)).save(aside, format="PNG")


def show_state(model: mujoco.MjModel, data: mujoco.MjData, state: NDArray[np.float64]) -> None:
    """Write a recorded state (1 + nq + nv,) so far that it can be drawn."""
    data.qpos[:] = state[1 : 1 + model.nq]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def beside_the_hand(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjvCamera:
    """A camera that looks at the hand from 0.9 m, over a shoulder or from where nothing stands between."""
    heading = float(np.degrees(base_pose(data)[1]))
    hand = data.site(GRIP_SITE).xpos
    best, most = mujoco.MjvCamera(), -1.0
    for elevation, side in itertools.product(_DOWN_DEG, _SIDES_DEG):
        azimuth = heading + side
        free = min(_seen_m(model, data, hand, azimuth, elevation), _CLOSE_M - _NEAR_HAND_M)
        if free > most:
            best.lookat, best.distance, best.azimuth, best.elevation = hand, _CLOSE_M, azimuth, elevation
            most = free
    return best


def _seen_m(
    model: mujoco.MjModel, data: mujoco.MjData, hand: NDArray[np.float64], azimuth: float, elevation: float
) -> float:
    """How far a camera at these angles (degrees) sees towards the hand, in metres."""
    across, up = np.radians(azimuth), np.radians(elevation)
    ahead = np.array([np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), np.sin(up)])
    hit = np.zeros(1, dtype=np.int32)
    free = mujoco.mj_ray(model, data, hand - _CLOSE_M * ahead, ahead, None, 1, -1, hit)
    return _CLOSE_M if free < 0 else float(free)
