"""Pictures of a task for its card: the kitchen at the start, and a strip of its demonstration; kept in files.

What is there already for the same split and seed, of the task as it is declared now and by the same software, is taken
as it is, so that work that was stopped goes on. A task that raised is tried again.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.film_strip import beside_the_hand, show_state
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import OF_THE_MACHINE
from robocasa_lerobot.files import write_text, written_aside
from robocasa_lerobot.gallery.scene_pictures import visitor_camera
from robocasa_lerobot.gallery.task_pages import page
from robocasa_lerobot.provenance import versions

START_SIZE = (270, 432)  # height and width, pixels
STRIP_PICTURES, STRIP_COLUMNS, STRIP_SIZE = 8, 4, 144
START_QUALITY, STRIP_QUALITY = 58, 40  # of WebP; 365 tasks are to fit in 15 MB
TRIES = 3  # seeds, until one is solved


@dataclass(frozen=True)
class Shown:
    """What the pictures of a task show.

    Attributes:
        split, seed: of the scene.
        instruction: of the episode; empty where it ended with an error.
        seconds: length of the demonstration; None without one.
        stages: of the episode, in words.
        failure: why the demonstration did not end well, or the error that there are no pictures for; empty where it
            did, or where there is none.
    """

    split: str
    seed: int
    instruction: str
    seconds: float | None = None
    stages: tuple[str, ...] = ()
    failure: str = ""


def make(name: str, split: str, seed: int, folder: Path) -> str:
    """Write `<name>_start.webp`, `<name>_strip.webp` where there is a demonstrator, and `<name>.json`; returns `name`.

    Of seeds from `seed` on, the first that the demonstrator solves; the last that was tried where it solves none. Of a
    task that raises there are no pictures.
    """
    if is_made(name, split, seed, folder):
        return name
    folder.mkdir(parents=True, exist_ok=True)
    start, strip = (folder / f"{name}_{kind}.webp" for kind in ("start", "strip"))
    with contextlib.closing(KitchenEnv(name, split=split, cameras=(), terminate_on_success=False)) as env:
        try:
            shown, states = _episode(env, seed)
        except OF_THE_MACHINE:
            raise
        except Exception as error:  # a task that breaks must not cost the page of all others
            shown = Shown(split, seed, "", failure=f"{type(error).__name__}: {error}")
            for old in (start, strip):  # of another seed
                old.unlink(missing_ok=True)
        else:
            _save(_start(env), start, START_QUALITY)
            if states is not None:
                _save(_strip(env, states), strip, STRIP_QUALITY)
    # Last: what has it is whole.
    write_text(folder / f"{name}.json", json.dumps({"asked": seed, "of": _made_of(name), **asdict(shown)}))
    return name


@functools.cache
def _made_of(name: str) -> dict[str, str]:
    """What the pictures of a task follow from: its declaration, in a digest of its page, and the software."""
    words = "\n".join(page(get_task(name)))
    return {"task": hashlib.sha256(words.encode()).hexdigest(), **versions("mujoco")}


def _episode(env: KitchenEnv, seed: int) -> tuple[Shown, NDArray[np.float64] | None]:
    """What is shown, and the states of its demonstration, if there is one; the env is at its start again."""
    if not can_demonstrate(get_task(env.task)):
        env.reset(seed=seed)
        return Shown(env.split, seed, env.task_description), None
    for tried in range(seed, seed + TRIES):
        recording = record_episode(env, tried)
        if recording.success:
            break
    shown = Shown(
        env.split,
        tried,
        env.task_description,
        len(recording.actions) / contract.CONTROL_HZ,
        tuple(stage["text"] for stage in recording.ep_meta["stages"]),
        "" if recording.success else recording.reason,
    )
    env.reset(seed=tried)
    return shown, recording.states


def is_made(name: str, split: str, seed: int, folder: Path) -> bool:
    """Whether there are pictures of a task for this split and seed; where it raised there are none."""
    shown = read(name, split, seed, folder)
    return shown is not None and shown.instruction != ""


def read(name: str, split: str, seed: int, folder: Path) -> Shown | None:
    """What was made of a task for this split and seed, as it is declared now; None where nothing was."""
    path = folder / f"{name}.json"
    if not path.exists():
        return None
    values = json.loads(path.read_text(encoding="utf-8"))
    if (values.pop("asked"), values.pop("of", None), values["split"]) != (seed, _made_of(name), split):
        return None
    return Shown(**{**values, "stages": tuple(values["stages"])})


def _start(env: KitchenEnv) -> NDArray[np.uint8]:
    renderer = SceneRenderer(env.model, *START_SIZE)
    try:
        return renderer.render(env.data, visitor_camera(env.scene, env.data))
    finally:
        renderer.close()


def _strip(env: KitchenEnv, states: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Pictures beside the hand, from the first state to the last, in rows of `STRIP_COLUMNS`."""
    data = mujoco.MjData(env.model)
    renderer = SceneRenderer(env.model, STRIP_SIZE, STRIP_SIZE)
    pictures = []
    try:
        for step in np.linspace(0, len(states) - 1, STRIP_PICTURES).round().astype(int):
            show_state(env.model, data, states[step])
            pictures.append(renderer.render(data, beside_the_hand(env.model, data)))
    finally:
        renderer.close()
    rows = [pictures[first : first + STRIP_COLUMNS] for first in range(0, len(pictures), STRIP_COLUMNS)]
    return np.vstack([np.hstack(row) for row in rows])


def _save(picture: NDArray[np.uint8], path: Path, quality: int) -> None:
    with written_aside(path) as aside:
        Image.fromarray(picture).save(aside, format="WEBP", quality=quality, method=6)
