"""A picture of a task: its first state, and the state that its demonstrator leaves, each seen from four sides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.titled import titled
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import written_aside
from robocasa_lerobot.gallery.scene_pictures import visitor_camera

Picture = NDArray[np.uint8]
_HEIGHT, _WIDE = 320, 480  # of each picture; the visitor's is wider


def render_states(task: str, out: Path, *, split: str = "target", seed: int = 0) -> str:
    """Write a picture with a row for the first state and one for the last; a sentence about how the attempt ended.

    A row has a visitor's view and those of the three cameras. A task without a demonstrator has the first row alone.

    Raises:
        UnknownNameError: no such task or split.
        UserError: the file's name does not end in .png or .jpg.
    """
    if out.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise UserError(f"--pictures {out}: expected a name that ends in .png or .jpg.")
    env = KitchenEnv(task, split=split, image_size=_HEIGHT, terminate_on_success=False)
    try:
        env.reset(seed=seed)
        rows = [titled(_row(env), f"{task}, seed {seed}: {env.task_description}")]
        if can_demonstrate(env.declaration):
            recording = record_episode(env, seed)
            ended = "done" if recording.success else f"not done ({recording.reason})"
            said = f"the demonstrator's end after {len(recording.actions) / 20:.1f} s: {ended}"
            rows.append(titled(_row(env), said))
        else:
            said = "no demonstrator yet, so there is no picture of the end"
    finally:
        env.close()
    out.parent.mkdir(parents=True, exist_ok=True)
    kind = "PNG" if out.suffix.lower() == ".png" else "JPEG"
    with written_aside(out) as aside:
        Image.fromarray(np.vstack(rows)).save(aside, format=kind, quality=90)
    return said


def _row(env: KitchenEnv) -> Picture:
    renderer = SceneRenderer(env.model, _HEIGHT, _WIDE)
    try:
        visitor = renderer.render(env.data, visitor_camera(env.scene, env.data))
    finally:
        renderer.close()
    return np.hstack([visitor, *(env.render_camera(camera) for camera in env.cameras)])
