"""Film strips: a whole demonstration at a glance, a row for each camera, time from left to right."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import base_pose
from robocasa_lerobot.demos.replay import kitchen_of, read_demonstration
from robocasa_lerobot.envs.scene.robot_names import GRIP_SITE

Picture = NDArray[np.uint8]
STRIP_PICTURES, STRIP_SIZE = 10, 224  # along the strip; pixels of each
_TITLE = 22
_CLOSE_M, _SIDE_DEG, _DOWN_DEG = 0.9, 40.0, -28.0  # of a camera that follows the hand, from over the shoulder


def film_strip(path: Path, demo: str, out: Path) -> None:
    """Write a PNG with the contract's cameras and one that follows the hand, from the first state to the last.

    Raises:
        UserError: the kitchen of the demonstration cannot be made again.
    """
    from robocasa_lerobot.gl import ensure_gl
    from robocasa_lerobot.rendering import SceneRenderer

    ensure_gl()
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
            pictures = [*renderer.pictures(data, contract.CAMERAS), renderer.render(data, _over_the_shoulder(data))]
            columns.append(_titled(np.vstack(pictures), f"{step / contract.CONTROL_HZ:.1f} s"))
    finally:
        if renderer is not None:
            renderer.close()
        env.close()
    title = f"{recorded.task}, {recorded.split}, seed {recorded.seed}: {recorded.instruction}"
    out.parent.mkdir(parents=True, exist_ok=True)
    aside = out.with_name(f".{out.name}")
    Image.fromarray(_titled(np.hstack(columns), title)).save(aside, format="PNG")
    aside.replace(out)


def show_state(model: mujoco.MjModel, data: mujoco.MjData, state: NDArray[np.float64]) -> None:
    """Write a recorded state (1 + nq + nv,) so far that it can be drawn."""
    data.qpos[:] = state[1 : 1 + model.nq]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def _over_the_shoulder(data: mujoco.MjData) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat = data.site(GRIP_SITE).xpos
    camera.distance, camera.elevation = _CLOSE_M, _DOWN_DEG
    camera.azimuth = float(np.degrees(base_pose(data)[1])) + _SIDE_DEG
    return camera


def _titled(picture: Picture, text: str) -> Picture:
    title = Image.new("RGB", (picture.shape[1], _TITLE), "white")
    ImageDraw.Draw(title).text((4, 4), text, fill="black", font_size=13)
    return np.vstack([np.asarray(title), picture])
