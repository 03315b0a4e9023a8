"""Scenes of demonstrations replayed state by state: poses for proprioception, pictures for the cameras.

Beside `scenes/compiled.py` the only module of the converter that imports MuJoCo. A process has at most one open scene
at a time, and makes its OpenGL context when the first picture is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.scenes.compiled import CompiledScene
from robocasa_lerobot.convert.settings import Camera
from robocasa_lerobot.envs.rendering import SceneRenderer


class Scene:
    """A compiled scene whose state is set from recordings; use it in a `with` block."""

    def __init__(self, compiled: CompiledScene) -> None:
        self._model, self._alike = compiled.model, compiled.alike
        self._data = mujoco.MjData(self._model)
        self._shadows = compiled.preset != "fast"
        self._renderers: dict[tuple[int, int], SceneRenderer] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the OpenGL context."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()

    @property
    def state_size(self) -> int:
        """Length 1 + nq + nv of a recorded state."""
        return int(1 + self._model.nq + self._model.nv)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Names of the cameras, in the order of the MJCF."""
        return tuple(self._model.camera(i).name for i in range(self._model.ncam))

    def set_state(self, state: NDArray[np.float64]) -> None:
        """Put the scene into a recorded state [time, qpos, qvel] of shape (1 + nq + nv,)."""
        if state.shape != (self.state_size,):
            raise RejectedEpisodeError(
                f"its states have {state.shape[-1]} numbers but its model_file has {self.state_size} "
                f"(1 + nq {self._model.nq} + nv {self._model.nv})."
            )
        self._data.time = state[0]
        self._data.qpos[:] = state[1 : 1 + self._model.nq]
        self._data.qvel[:] = state[1 + self._model.nq :]
        # What pictures and poses need of mj_forward.
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def site_pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """World position (3,) in metres and rotation matrix (3, 3) of a site."""
        site = self._data.site(name)
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy()

    def body_rotation(self, name: str) -> NDArray[np.float64]:
        """World rotation matrix (3, 3) of a body."""
        return self._data.body(name).xmat.reshape(3, 3).copy()

    def joint_positions(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Positions of one-degree-of-freedom joints (n,), in metres or radians."""
        return np.array([self._data.joint(name).qpos[0] for name in names])

    def pictures(self, cameras: Sequence[Camera]) -> dict[str, NDArray[np.uint8]]:
        """What cameras see in the present state: upright (height, width, 3) uint8 RGB by name.

        Raises:
            NoOpenGLError: this machine cannot render; the message has the remedy.
        """
        found: dict[str, NDArray[np.uint8]] = {}
        for size in dict.fromkeys((camera.height, camera.width) for camera in cameras):
            names = [camera.name for camera in cameras if (camera.height, camera.width) == size]
            if size not in self._renderers:
                renderer = SceneRenderer(self._model, *size, shadows=self._shadows, alike=self._alike)
                self._renderers[size] = renderer
            found.update(zip(names, self._renderers[size].pictures(self._data, names), strict=True))
        return found
