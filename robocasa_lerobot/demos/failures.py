"""Failed attempts that are kept: a film, and what was missing for success."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import mujoco

from robocasa_lerobot import contract
from robocasa_lerobot.demos.film_strip import show_state
from robocasa_lerobot.demos.hdf5 import Failure
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.files import write_text


def film_of(folder: Path, seed: int) -> Path:
    """The description (JSON) of the failure with a seed; its film has the same name with `.mp4`."""
    return folder / f"seed_{seed:06d}.json"


def keep_failure(folder: Path, env: KitchenEnv, failure: Failure, recording: Recording | None) -> None:
    """Write a failure's film and description; the description, which comes last, says that both are there.

    Args:
        folder: of the task's failures.
        env: still in the scene of the attempt.
        failure: what went wrong.
        recording: of the attempt; None, and so no film, where it raised what no skill should.
    """
    folder.mkdir(parents=True, exist_ok=True)
    place = film_of(folder, failure.seed)
    described: dict[str, Any] = dataclasses.asdict(failure)
    if recording is not None:
        described |= {
            "steps": len(recording.actions),
            "seconds": len(recording.actions) / contract.CONTROL_HZ,
            "instruction": recording.ep_meta["lang"],
            **{key: recording.ep_meta[key] for key in ("split", "layout_id", "style_id")},
        }
        if len(recording.states):
            _film(place.with_suffix(".mp4"), env, recording)
            described["film"] = place.with_suffix(".mp4").name
    write_text(place, json.dumps(described, indent=1) + "\n")


def remove_others(folder: Path, failures: list[Failure]) -> None:
    """Remove the files of attempts that turned out not to be needed."""
    kept = {film_of(folder, failure.seed).stem for failure in failures}
    for file in folder.glob("seed_*"):
        if file.stem not in kept:
            file.unlink()


def _film(path: Path, env: KitchenEnv, recording: Recording) -> None:
    from robocasa_lerobot.gl import ensure_drawing
    from robocasa_lerobot.video import FILM_EVERY, FILM_SIZE, VideoWriter, side_by_side

    ensure_drawing()
    model, data = env.model, mujoco.MjData(env.model)
    renderer = env.renderer_of_size(FILM_SIZE, FILM_SIZE)
    try:
        with VideoWriter(path, contract.CONTROL_HZ // FILM_EVERY) as film:
            for state in recording.states[::FILM_EVERY]:
                show_state(model, data, state)
                pictures = renderer.pictures(data, contract.CAMERAS)
                film.write(side_by_side(dict(zip(contract.CAMERAS, pictures, strict=True))))
    finally:
        renderer.close()
