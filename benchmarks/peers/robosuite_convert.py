"""The rendering half of the official conversion, for `convert_speed.py`. Runs in robosuite's own virtual environment.

As robomimic's and RoboCasa's tools do it: every state is put into the full environment, all its observations are
computed, and every picture becomes a PNG file, named and compressed as LeRobot's image writer does, by threads.
"""

from __future__ import annotations

import importlib.metadata
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import robosuite
import sim_loop
from numpy.typing import NDArray
from PIL import Image

CONTROL_HZ = 20
COMPRESS_LEVEL = 1  # LeRobot's


class StatesToPictures:
    """robosuite's Lift env with its Panda, put into recorded states."""

    def __init__(self) -> None:
        self._env: Any = None
        self._cameras: list[str] = []

    def hello(self) -> dict[str, Any]:
        """An answer, which says that everything is imported."""
        return {}

    def make(self, cameras: list[str], size: int) -> dict[str, Any]:
        """Construct the env; everything but the cameras is robosuite's default, shadows included."""
        self._cameras = cameras
        start = time.perf_counter()
        self._env = robosuite.make(
            "Lift",
            robots="Panda",
            has_renderer=False,
            has_offscreen_renderer=True,
            use_camera_obs=True,
            camera_names=cameras,
            camera_heights=size,
            camera_widths=size,
            control_freq=CONTROL_HZ,
            ignore_done=True,
        )
        self._env.reset()
        return {
            "construct_s": time.perf_counter() - start,
            "versions": {name: importlib.metadata.version(name) for name in ("robosuite", "mujoco", "numpy")},
        }

    def pictures(self, states: str, folder: str, threads: int) -> dict[str, Any]:
        """Write every state's pictures below `folder`, as `<demo>/<camera>/frame-000000.png`."""
        with np.load(states) as file:
            demos = {name: file[name] for name in file.files}
        start = time.perf_counter()
        writes: list[Future[None]] = []
        with ThreadPoolExecutor(threads) as pool:
            for name, rows in demos.items():
                folders = {camera: Path(folder) / name / camera for camera in self._cameras}
                for place in folders.values():
                    place.mkdir(parents=True)
                for step, row in enumerate(rows):
                    observation = self._observation(row)
                    for camera, place in folders.items():
                        picture = observation[f"{camera}_image"][::-1]  # robosuite's are bottom-up
                        writes.append(pool.submit(_write, picture, place / f"frame-{step:06d}.png"))
            rendered = time.perf_counter()
        for write in writes:
            write.result()
        end = time.perf_counter()
        frames = sum(len(rows) for rows in demos.values())
        return {"frames": frames, "seconds": end - start, "rendering_s": rendered - start}

    def _observation(self, state: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        sim = self._env.sim
        sim.set_state_from_flattened(state)
        sim.forward()
        self._env.update_state()
        observation: dict[str, NDArray[Any]] = self._env._get_observations(force_update=True)
        return observation


def _write(picture: NDArray[np.uint8], path: Path) -> None:
    Image.fromarray(np.ascontiguousarray(picture)).save(path, compress_level=COMPRESS_LEVEL)


if __name__ == "__main__":
    program = StatesToPictures()
    sim_loop.answer_commands(program.hello, program.make, program.pictures)
