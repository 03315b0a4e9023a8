"""Help on a click: drive to a place on the map, or bring the hand above what is seen in a picture; ordinary actions."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    base_pose,
    frame,
    hand_rotation,
    nearer_turn,
)
from robocasa_lerobot.demos.planning.base_path import carried
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.common import SkillError, move_hand
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.reaching import WaypointPath, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.projection import camera_matrix
from robocasa_lerobot.envs.rendering import SceneRenderer

ABOVE_M = (0.12, 0.16, 0.20)  # of the top of what is reached for, the nearest that there is a path to
_YAWS = 8
_PIXELS = 256


def drive(env: KitchenEnv, x: float, y: float, yaw: float | None, *, closed: bool) -> Iterator[Array]:
    """Actions that drive the base centre to a place, metres, with a heading in radians, or the present one.

    Raises:
        SkillError: while they are drawn: there is no path, or the base got stuck.
    """
    heading = base_pose(env.data)[1] if yaw is None else yaw
    return drive_to(env, x, y, heading, gripper=CLOSED if closed else OPEN, tolerance_m=0.03, tolerance_rad=0.05)


def reach_above(env: KitchenEnv, point: Array, *, closed: bool) -> Iterator[Array]:
    """Actions that bring the hand above a point (3,), fingers down, the base standing.

    Raises:
        SkillError: while they are drawn: there is no path that touches nothing.
    """
    gripper = CLOSED if closed else OPEN
    held = carried(env.scene, env.data) if closed else None
    now = hand_rotation(env.data)
    paths = []
    for above in ABOVE_M:
        for index in range(_YAWS):
            angle = np.pi * index / _YAWS
            opening = np.array([np.cos(angle), np.sin(angle), 0.0])
            turn = nearer_turn(frame(-UP, opening), now)
            away = 1.0 - (float(np.trace(turn.T @ now)) - 1.0) / 2.0  # the less it turns, the better
            paths.append(WaypointPath((HandTarget(point + above * UP, turn),), 0.1 * away + 2.0 * (above - ABOVE_M[0])))
    found = plan_reach(env, paths, point, key=0, held=held, loaded=0 if held is None else 1, may_drive=False)
    if not found:
        raise SkillError("there is no path for the hand to above that place from where the robot stands")
    yield from follow_joint_path(env, found[0].joints, gripper)
    yield from move_hand(env.data, found[0].targets[0], gripper, max_steps=40)


def point_under(
    env: KitchenEnv, data: mujoco.MjData, camera: str | mujoco.MjvCamera, u: float, v: float
) -> tuple[str, Array]:
    """What is seen at a place of a picture, and the point (3,) to reach above: the top of an object, else the place.

    Args:
        env: in the present state; an object is reached for where it is now.
        data: in the state of the picture.
        camera: of the picture, square; a name or a free one.
        u: to the right, share of the picture.
        v: down, share of the picture.

    Raises:
        SkillError: nothing is there, or the robot itself.
    """
    renderer = SceneRenderer(env.model, _PIXELS, _PIXELS)
    try:
        column, row = min(int(u * _PIXELS), _PIXELS - 1), min(int(v * _PIXELS), _PIXELS - 1)
        depth, ids = renderer.geometry(data, camera)
        geom, far = int(ids[row, column]), float(depth[row, column])
    finally:
        renderer.close()
    if geom < 0:
        raise SkillError("nothing is to be seen there")
    model = env.model
    body = int(model.geom_bodyid[geom])
    if env.scene.subtree(env.robot.names.base)[body]:
        raise SkillError("that is the robot itself")
    for name in env.scene.objects:
        if env.scene.subtree(name)[body]:
            return name, _top_of(env, name)
    return model.body(int(model.body_rootid[body])).name, _seen_point(model, data, camera, u, v, far)


def _top_of(env: KitchenEnv, name: str) -> Array:
    """Above an object's middle, at the height of its highest point."""
    model, data = env.model, env.data
    geoms = np.flatnonzero(env.scene.subtree(name)[model.geom_bodyid])
    rotations = data.geom_xmat.reshape(-1, 3, 3)[geoms]
    middle = data.geom_xpos[geoms] + (rotations @ model.geom_aabb[geoms, :3, None])[:, :, 0]
    half = (np.abs(rotations) @ model.geom_aabb[geoms, 3:, None])[:, :, 0]
    low, high = (middle - half).min(axis=0), (middle + half).max(axis=0)
    return np.array([*((low + high) / 2)[:2], high[2]])


def _seen_point(
    model: mujoco.MjModel, data: mujoco.MjData, camera: str | mujoco.MjvCamera, u: float, v: float, depth: float
) -> Array:
    """The world point at a place of a square picture and a depth in metres along the optical axis."""
    if isinstance(camera, str):
        intrinsics, pose = camera_matrix(model, data, camera, _PIXELS)
        pixel = np.array([u * _PIXELS - 0.5, v * _PIXELS - 0.5, 1.0])
        local = np.linalg.inv(intrinsics) @ pixel * depth
        return np.asarray(pose[:3, :3] @ local + pose[:3, 3])
    azimuth, elevation = np.radians(camera.azimuth), np.radians(camera.elevation)
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    up = np.cross(right, forward)
    half = float(np.tan(np.radians(model.vis.global_.fovy) / 2))
    eye = np.array(camera.lookat) - camera.distance * forward
    return np.asarray(eye + depth * (forward + half * ((2 * u - 1) * right + (1 - 2 * v) * up)))
