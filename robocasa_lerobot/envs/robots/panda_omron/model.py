"""The PandaOmron robot for `mujoco.MjSpec`: bodies, joints, actuators, sites, cameras, shapes, and where it stands.

The Franka meshes are those of the installed `gymnasium_robotics` package; they are named by their path below the
site-packages folder, so that a written MJCF is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

from robocasa_lerobot.envs.robots.cameras import CameraSpec, add_cameras
from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.bodies import BODIES, BodySpec, JointSpec
from robocasa_lerobot.envs.robots.panda_omron.shapes import add_shapes
from robocasa_lerobot.errors import LackingMachineError, UnknownNameError

QUALITIES = ("fast", "quality")
SPAWN_POSITION = (10.0, 10.0, 0.0)  # of the model; the base joints then carry it to its place, as in RoboCasa's files

_ARM_TORQUE_NM = (80.0, 80.0, 80.0, 80.0, 80.0, 12.0, 12.0)
_BASE_KV = (1000.0, 1000.0, 1500.0)
_BASE_SPEED = (1.0, 1.0, 1.5)  # m/s, m/s, rad/s at a full command
_BASE_FORCE = 600.0
_TORSO_FORCE_N = 1.0e5
_FINGER_KP = 1000.0
_FINGER_FORCE_N = 20.0
_FINGER_CTRL = ((0.0, 0.04), (-0.04, 0.0))

_MESH_FOLDER = "envs/assets/kitchen_franka/franka_assets/meshes"
_MESH_NAMES = (*(f"link{i}" for i in range(8)), "hand", "finger")


def add_robot(
    spec: mujoco.MjSpec,
    quality: str,
    cameras: Sequence[CameraSpec] = (),
    spawn_position: tuple[float, float, float] = SPAWN_POSITION,
) -> None:
    """Add the PandaOmron to the world of `spec`, its zero configuration at `spawn_position` (metres), facing +x.

    `quality` chooses the look only ("fast": low-polygon meshes, "quality": full ones): masses, joints and collision
    shapes are the same in both.

    Raises:
        UnknownNameError: there is no such quality.
    """
    if quality not in QUALITIES:
        raise UnknownNameError("robot quality", quality, QUALITIES)
    for body in BODIES:
        _add_body(spec, body, spawn_position)
        for joint in body.joints:
            _add_joint(spec, body.name, joint)
    _add_sites(spec)
    _add_meshes(spec, quality)
    add_shapes(spec, quality)
    add_cameras(spec, cameras)
    _add_actuators(spec)


@cache
def mesh_bytes(quality: str) -> dict[str, bytes]:
    """The Franka mesh files of one look ("fast" or "quality"), by their portable names.

    Raises:
        LackingMachineError: gymnasium-robotics is not installed.
    """
    folder = "collision" if quality == "fast" else "visual"
    # Found without importing it: its import takes longer than compiling a kitchen.
    package = find_spec("gymnasium_robotics")
    if package is None or package.origin is None:
        raise LackingMachineError(
            "the Franka meshes come with the package gymnasium-robotics, which is not installed. Install it."
        )
    root = Path(package.origin).parent / _MESH_FOLDER / folder
    return {_mesh_file(folder, name): (root / f"{name}.stl").read_bytes() for name in _MESH_NAMES}


def _mesh_file(folder: str, name: str) -> str:
    return f"gymnasium_robotics/{_MESH_FOLDER}/{folder}/{name}.stl"


def _add_body(spec: mujoco.MjSpec, body: BodySpec, spawn_position: tuple[float, float, float]) -> None:
    parent = spec.body(body.parent) if body.parent else spec.worldbody
    pos = body.pos if body.parent else spawn_position
    added = parent.add_body(name=body.name, pos=pos, quat=body.quat)
    added.explicitinertial = True
    added.mass = body.mass
    added.ipos = body.com
    added.iquat = body.inertia_quat
    added.inertia = body.inertia


def _add_joint(spec: mujoco.MjSpec, body: str, joint: JointSpec) -> None:
    kinds = {"slide": mujoco.mjtJoint.mjJNT_SLIDE, "hinge": mujoco.mjtJoint.mjJNT_HINGE}
    added = spec.body(body).add_joint(name=joint.name, type=kinds[joint.kind], axis=joint.axis, pos=joint.anchor)
    added.frictionloss = joint.frictionloss
    added.damping = (joint.damping, 0.0, 0.0)  # a polynomial in the velocity: linear
    added.armature = joint.armature
    added.limited = mujoco.mjtLimited.mjLIMITED_FALSE if joint.range is None else mujoco.mjtLimited.mjLIMITED_TRUE
    if joint.range is not None:
        # Ranges of hinges are in the unit of the whole spec, which is the degree unless it says otherwise.
        in_degrees = joint.kind == "hinge" and bool(spec.compiler.degree)
        added.range = np.degrees(joint.range) if in_degrees else joint.range


def _add_sites(spec: mujoco.MjSpec) -> None:
    where = {
        names.BASE_CENTER_SITE: names.SUPPORT,
        names.ARM_CENTER_SITE: "robot0_link0",
        names.GRIP_SITE: "gripper0_right_eef",
    }
    for site, body in where.items():
        # Group 5 is drawn by no camera.
        spec.body(body).add_site(name=site, pos=(0.0, 0.0, 0.0), size=(0.01, 0.01, 0.01), group=5)


def _add_meshes(spec: mujoco.MjSpec, quality: str) -> None:
    """Mesh assets: the low-polygon ones collide in either look, and are also what the fast look draws."""
    for suffix, look in (("", "fast"), *((("_full", "quality"),) if quality == "quality" else ())):
        folder = "collision" if look == "fast" else "visual"
        for name in _MESH_NAMES:
            mesh = spec.add_mesh(name=f"robot0_{name}{suffix}", file=_mesh_file(folder, name))
            mesh.smoothnormal = look == "fast"
        spec.assets.update(mesh_bytes(look))


def _add_actuators(spec: mujoco.MjSpec) -> None:
    for name, joint, torque in zip(names.ARM_ACTUATORS, names.ARM_JOINTS, _ARM_TORQUE_NM, strict=True):
        _actuator(spec, name, joint, (-torque, torque)).set_to_motor()
    for i, name in enumerate(names.BASE_ACTUATORS):
        actuator = _actuator(spec, name, names.BASE_JOINTS[i], (-_BASE_SPEED[i], _BASE_SPEED[i]), _BASE_FORCE)
        actuator.set_to_velocity(kv=_BASE_KV[i])
    _actuator(spec, names.TORSO_ACTUATOR, names.TORSO_JOINT, (-_TORSO_FORCE_N, _TORSO_FORCE_N)).set_to_motor()
    for name, joint, ctrl in zip(names.FINGER_ACTUATORS, names.FINGER_JOINTS, _FINGER_CTRL, strict=True):
        _actuator(spec, name, joint, ctrl, _FINGER_FORCE_N).set_to_position(kp=_FINGER_KP)


def _actuator(
    spec: mujoco.MjSpec, name: str, joint: str, ctrl: tuple[float, float], force: float | None = None
) -> mujoco.MjsActuator:
    actuator = spec.add_actuator(name=name, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
    actuator.ctrlrange = ctrl
    if force is not None:
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = (-force, force)
    return actuator
