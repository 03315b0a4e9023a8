"""What can be grasped: objects of a scene, and loose parts of fixtures such as a blender's lid."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, rotation_about
from robocasa_lerobot.demos.planning.grasps import GraspPose, grasp_poses, grasp_poses_of, pieces
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.objects.catalogue import Instance
from robocasa_lerobot.envs.objects.solids import Solid, hull

UPRIGHT_COS = 0.98  # tilts up to 11 degrees count as standing as it was put down
LOAD_M = 0.10  # an object's origin is less than this over the inside of what it lies in, or over its top
DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Graspable:
    """A loose body.

    Attributes:
        name: of the body.
        title: for messages.
        solids: convex pieces in its frame.
        cloud: points (n, 3) whose hull it fills.
        item: the object model, if it is one.
        bodies: ids of what belongs to it.
        contents: names of the objects in or on it, which go where it goes.
        carried: ids of the bodies of these.
    """

    name: str
    title: str
    solids: tuple[Solid, ...]
    cloud: Array
    item: Instance | None
    bodies: frozenset[int]
    contents: tuple[str, ...] = ()
    carried: frozenset[int] = frozenset()

    def below(self, rotation: Array) -> float:
        """How far its underside is below its origin when it is turned so, metres."""
        return -float((self.cloud @ rotation[2]).min())

    def half_extents(self, rotation: Array) -> Array:
        """Farthest that it reaches from its origin along each axis of the room, (3,), metres."""
        reach: Array = np.abs(self.cloud @ rotation.T).max(axis=0)
        return reach


def graspable(env: KitchenEnv, name: str) -> Graspable:
    """The loose body of a name, which may name a role in braces."""
    name = env.scene.fill(name)
    bodies = frozenset(np.flatnonzero(env.scene.subtree(name)).tolist())
    placed = env.scene.objects.get(name)
    if placed is None:
        solids = _solids(env.model, env.model.body(name).id)
        return Graspable(name, name, solids, np.concatenate([s.cloud() for s in solids]), None, bodies)
    found = tuple(pieces(placed.item))
    cloud = np.concatenate([s.cloud() for s in found])
    contents = contents_of(env, name)
    carried = frozenset(np.flatnonzero(env.scene.subtree(*contents)).tolist()) if contents else frozenset()
    return Graspable(name, f"{name} ({placed.item.model})", found, cloud, placed.item, bodies, contents, carried)


def contents_of(env: KitchenEnv, name: str) -> tuple[str, ...]:
    """Names of the objects whose origins are in or over an object's inside, or over its top, as all lie now."""
    holder, body = env.scene.objects[name].item, env.data.body(name)
    if holder.interior is not None:
        center, half = np.array(holder.interior.center), np.array(holder.interior.half)
    else:
        center, half = np.array([0.0, 0.0, holder.size[2] / 2]), np.array(holder.size) / 2
    floor = center[2] - (half[2] if holder.interior is not None else 0.0)
    found = []
    for other in env.scene.objects:
        if other != name:
            x, y, z = body.xmat.reshape(3, 3).T @ (env.data.body(other).xpos - body.xpos)
            over = abs(x - center[0]) < half[0] and abs(y - center[1]) < half[1]
            if over and floor < z < center[2] + half[2] + LOAD_M:
                found.append(other)
    return tuple(found)


def half_length(env: KitchenEnv, name: str) -> float:
    """Half of the longer edge of an object's bounding box as seen from above, metres: the radius of a round one."""
    return max(env.scene.objects[name].item.size[:2]) / 2


def holder_of(env: KitchenEnv, name: str) -> str:
    """Name of the object that an object is in or on; empty where there is none."""
    holders = (other for other in env.scene.objects if other != name and name in contents_of(env, other))
    return min(holders, key=lambda other: float(np.prod(env.scene.objects[other].item.size)), default="")


def grasps(
    env: KitchenEnv,
    obj: Graspable,
    approach: Array,
    beyond: tuple[Array, float] | None = None,
    *,
    over_floor: bool = False,
) -> list[GraspPose]:
    """Grasp poses in the room for an object as it lies now, by a hand that comes along `approach` (unit vector).

    With `beyond` only those that lie farther than so many metres from its origin along a direction in its axes; with
    `over_floor` only those by which a hand that leans keeps its lower finger over what the object lies on.
    """
    body = env.data.body(obj.name)
    turn = body.xmat.reshape(3, 3).copy()
    if approach @ DOWN > 0.999:
        upright = np.hypot(turn[0, 0], turn[1, 0])
        if obj.item is not None and turn[2, 2] > UPRIGHT_COS and upright > 1e-6 and beyond is None:
            yaw = np.array([[turn[0, 0], -turn[1, 0], 0], [turn[1, 0], turn[0, 0], 0], [0, 0, 1.0]])
            yaw[:2, :2] /= upright
            return [pose.placed(body.xpos, yaw) for pose in grasp_poses(obj.item, env.robot.gripper)]
        tip = np.eye(3)
    else:
        tip = _to_down(approach)
    floor = (tip @ UP, obj.below(turn)) if over_floor else None
    poses = grasp_poses_of(list(obj.solids), tip @ turn, env.robot.gripper, beyond=beyond, floor=floor)
    back = tip.T
    return [GraspPose(body.xpos + back @ pose.position, back @ pose.rotation, pose.width, pose.score) for pose in poses]


def filled(cloud: Array) -> Array:
    """Points on the lines between the points of a convex piece."""
    first, second = np.triu_indices(len(cloud))
    shares = np.array([0.0, 0.25, 0.5, 0.75])[:, None, None]
    inside: Array = ((1 - shares) * cloud[first] + shares * cloud[second]).reshape(-1, 3)
    return inside


def _to_down(approach: Array) -> Array:
    """The smallest rotation that brings a direction to straight down."""
    axis = np.cross(approach, DOWN)
    sine, cosine = float(np.linalg.norm(axis)), float(approach @ DOWN)
    return rotation_about(axis / sine, float(np.arctan2(sine, cosine)))


def _solids(model: mujoco.MjModel, body: int) -> tuple[Solid, ...]:
    """What collides of a body, each as the convex hull of its geom."""
    found = []
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        out = np.empty(9)
        mujoco.mju_quat2Mat(out, model.geom_quat[geom])
        found.append(hull(_points(model, geom) @ out.reshape(3, 3).T + model.geom_pos[geom]))
    return tuple(found)


def _points(model: mujoco.MjModel, geom: int) -> Array:
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        return np.array(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=np.float64)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return Solid("cylinder", (float(size[0]), float(size[1]))).cloud()
    return Solid("box", tuple(float(s) for s in size)).cloud()
