"""Pictures for people: the robot's cameras, one that flies along, the kitchen from above; all as JPEG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import base_pose
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.robots.panda_omron.names import ROBOT_BASE
from robocasa_lerobot.teleop.messages import Message
from robocasa_lerobot.teleop.settings import PICTURE_QUALITY

Picture = NDArray[np.uint8]

FREE = "free"
SEEN = (*contract.CAMERAS, FREE)
_LOOK_AT_M = 0.9  # height of what the free camera looks at
_RAISE_RAD, _HIGHEST_RAD = 0.15, -1.45  # the free camera goes up where something is in its way, in such steps
_CLEAR_M, _NEAREST_M = 0.1, 0.6  # it stays that far before what is in its way, and from the robot
_PAST_M = 0.05  # beyond a part of the robot, which is in nobody's way
_MAP_PIXELS, _MAP_MARGIN_M = 640, 0.15
_MAP_FROM_M = 12.0  # height that the map is seen from: the higher, the less does what is tall lean outwards
_CUT_M = 1.55  # geoms that are wholly above it hide nothing on the map
_HIDDEN_GROUP = 5


def jpeg(picture: Picture, quality: int = PICTURE_QUALITY) -> bytes:
    """A picture (H, W, 3) RGB as JPEG."""
    good, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert good
    return data.tobytes()


@dataclass
class FreeCamera:
    """The camera that flies along with the robot, or stays where it was put.

    Attributes:
        follow: whether its angle is relative to the robot's heading, and it goes along.
        azimuth, elevation: radians; distance: metres, from what it looks at.
    """

    follow: bool = True
    azimuth: float = 0.6
    elevation: float = -0.5
    distance: float = 2.2
    anchor: tuple[float, float] | None = None

    def set(self, message: Message, data: mujoco.MjData) -> None:
        """Take the fields of a `view` message; a camera that does not follow looks at where the robot is now."""
        for name in ("follow", "azimuth", "elevation", "distance"):
            setattr(self, name, message.get(name, getattr(self, name)))
        x, y = base_pose(data)[0][:2].tolist()
        self.anchor = None if self.follow else self.anchor or (x, y)

    def camera(self, data: mujoco.MjData) -> mujoco.MjvCamera:
        """The camera for a state."""
        position, heading = base_pose(data)
        camera = mujoco.MjvCamera()
        x, y = self.anchor or position[:2].tolist()
        camera.lookat = [x, y, _LOOK_AT_M]
        turn = self.azimuth + (heading if self.follow else 0.0)
        elevation, distance = _in_the_open(data, np.array(camera.lookat), turn, self.elevation, self.distance)
        camera.azimuth, camera.elevation = float(np.degrees(turn)), float(np.degrees(elevation))
        camera.distance = distance
        return camera


def _in_the_open(
    data: mujoco.MjData, target: NDArray[np.float64], azimuth: float, elevation: float, distance: float
) -> tuple[float, float]:
    """Elevation and distance from which nothing but the robot hides the target: higher up if need be, else nearer."""
    best = elevation, 0.0
    for raised in (elevation, *np.arange(elevation - _RAISE_RAD, _HIGHEST_RAD, -_RAISE_RAD)):
        back = -np.array([np.cos(raised) * np.cos(azimuth), np.cos(raised) * np.sin(azimuth), np.sin(raised)])
        free = _free_way(data, target, back, distance)
        if free >= distance:
            return float(raised), distance
        if free > best[1]:
            best = float(raised), free
    return best[0], max(best[1] - _CLEAR_M, _NEAREST_M)


def _free_way(data: mujoco.MjData, start: NDArray[np.float64], way: NDArray[np.float64], far: float) -> float:
    """Metres along a unit vector to the first thing that is not the robot, at most `far`."""
    model, hit, gone = data.model, np.full(1, -1, dtype=np.int32), 0.0
    robot = model.body_rootid[model.body(ROBOT_BASE).id]
    while gone < far:
        step = mujoco.mj_ray(model, data, start + gone * way, way, None, 1, -1, hit)
        if step < 0:
            return far
        gone += step
        if model.body_rootid[model.geom_bodyid[hit[0]]] != robot:
            return min(gone, far)
        gone += _PAST_M
    return far


class Views:
    """Draws what clients see of a kitchen, in one size.

    Args:
        size: height and width, pixels.
        preset: "fast" or "quality".
    """

    def __init__(self, size: int, preset: str) -> None:
        self._size, self._shadows = size, preset == "quality"
        self._renderer: SceneRenderer | None = None

    def open(self, env: KitchenEnv) -> None:
        """Of the running episode's kitchen from now on.

        Raises:
            NoOpenGLError: nothing on this machine can render.
        """
        self.close()
        self._renderer = SceneRenderer(env.model, self._size, self._size, shadows=self._shadows)

    def close(self) -> None:
        """Free what is kept of a kitchen."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def take(
        self, env: KitchenEnv, seen: Mapping[str, Picture], cameras: Sequence[str], free: FreeCamera
    ) -> list[tuple[dict[str, Any], bytes]]:
        """Pictures of the present state: of each what it is, and the JPEG.

        Args:
            env: in that state.
            seen: pictures of it that there are already; those of another size are not used.
            cameras: wanted, of `SEEN`.
            free: where the free one is.
        """
        assert self._renderer is not None, "no kitchen is open"
        pictures = {name: picture for name, picture in seen.items() if len(picture) == self._size}
        missing = [name for name in cameras if name not in pictures and name != FREE]
        pictures |= dict(zip(missing, self._renderer.pictures(env.data, missing), strict=True))
        if FREE in cameras:
            pictures[FREE] = self._renderer.render(env.data, free.camera(env.data))
        out = []
        for name in cameras:
            data = jpeg(pictures[name])
            out.append(({"camera": name, "bytes": len(data), "width": self._size, "height": self._size}, data))
        return out


@dataclass(frozen=True)
class KitchenMap:
    """The kitchen from above without what hangs: `left` and `top` are the world's x and y of its upper left corner."""

    jpeg: bytes
    width: int
    height: int
    left: float
    top: float
    metres_per_pixel: float

    def describe(self) -> dict[str, Any]:
        """As it is told to clients, but for its address."""
        return {
            "width": self.width,
            "height": self.height,
            "left": self.left,
            "top": self.top,
            "metres_per_pixel": self.metres_per_pixel,
        }


def kitchen_map(env: KitchenEnv) -> KitchenMap:
    """Draw the running episode's kitchen from above; the robot is left out: it moves."""
    room = env.scene.layout.room
    left, right = room["x_min"] - _MAP_MARGIN_M, room["x_max"] + _MAP_MARGIN_M
    bottom, top = room["y_min"] - _MAP_MARGIN_M, _MAP_MARGIN_M  # the back wall stands at y = 0
    scale = max(right - left, top - bottom) / _MAP_PIXELS
    width, height = round((right - left) / scale), round((top - bottom) / scale)
    model, data = env.model, env.data
    groups, fovy = model.geom_group.copy(), model.vis.global_.fovy
    robot = env.scene.subtree(env.robot.names.base)[model.geom_bodyid]
    down = data.geom_xmat.reshape(-1, 3, 3)[:, 2]  # the world's z in the geoms' axes
    middle = data.geom_xpos[:, 2] + (down * model.geom_aabb[:, :3]).sum(axis=1)
    low = middle - (np.abs(down) * model.geom_aabb[:, 3:]).sum(axis=1)
    planes = model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
    camera = mujoco.MjvCamera()
    camera.lookat = [(left + right) / 2, (bottom + top) / 2, 0.0]
    camera.distance, camera.azimuth, camera.elevation = _MAP_FROM_M, 90.0, -90.0
    try:
        model.geom_group[robot | ((low > _CUT_M) & ~planes)] = _HIDDEN_GROUP
        model.vis.global_.fovy = float(np.degrees(2 * np.arctan((top - bottom) / 2 / _MAP_FROM_M)))
        renderer = SceneRenderer(model, height, width, keeps_backgrounds=False)
        try:
            picture = renderer.render(data, camera)
        finally:
            renderer.close()
    finally:
        model.geom_group[:], model.vis.global_.fovy = groups, fovy
    return KitchenMap(jpeg(picture), width, height, left, top, scale)
