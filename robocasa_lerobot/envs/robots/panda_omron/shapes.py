"""Shapes of the PandaOmron: collision geoms (group 0, the same in every look) and visual geoms (group 1).

The arm's shapes are the Franka meshes, drawn in their own link frames; base, column and finger pads are primitives.
The shapes carry no mass: every body has its explicit inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.bodies import IDENTITY, Quat, Vec3

COLLISION_GROUP, VISUAL_GROUP = 0, 1

_BOX = mujoco.mjtGeom.mjGEOM_BOX
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
_MESH = mujoco.mjtGeom.mjGEOM_MESH

# robosuite turns the gripper's frame by -90 degrees about the hand's z; the hand mesh is modelled in the Franka
# hand's frame, which is where the finger frames are turned back to.
_HAND_MESH_QUAT: Quat = (0.707107, 0.0, 0.0, 0.707107)
_HALF_TURN_Z: Quat = (0.0, 0.0, 0.0, 1.0)
_WHEEL_QUAT: Quat = (0.707107, 0.707107, 0.0, 0.0)  # cylinder axis along y

# Half sizes and centre (tip frame, metres) of the rubber pads. They stand 0.3 mm proud of the finger's mesh so that
# a grasped object touches the pad with its high friction first, and end 1 mm below the finger tip.
_PAD_SIZE: Vec3 = (0.0085, 0.0040, 0.0105)
_PAD_CENTER: Vec3 = (0.0, -0.0048, -0.0114)
_PAD_FRICTION: Vec3 = (2.0, 0.05, 0.0001)


@dataclass(frozen=True)
class _Material:
    rgba: tuple[float, float, float, float]
    specular: float
    shininess: float


_MATERIALS = {
    "robot0_white": _Material((0.86, 0.87, 0.88, 1.0), 0.3, 0.5),
    "robot0_grey": _Material((0.45, 0.46, 0.48, 1.0), 0.3, 0.4),
    "robot0_dark": _Material((0.13, 0.13, 0.15, 1.0), 0.2, 0.3),
    "robot0_blue": _Material((0.10, 0.35, 0.65, 1.0), 0.3, 0.4),
}


@dataclass(frozen=True)
class _Piece:
    """A visual primitive of the base: size as MuJoCo takes it (half sizes; radius and half length)."""

    body: str
    kind: int
    size: Vec3
    pos: Vec3
    material: str
    quat: Quat = IDENTITY


_WHEELED = "mobilebase0_wheeled_base"
_COLUMN_LOWER = "mobilebase0_fixed_support"
_BASE_LOOK = (
    _Piece(_WHEELED, _BOX, (0.345, 0.245, 0.075), (0.0, 0.0, -0.065), "robot0_dark"),
    _Piece(_WHEELED, _BOX, (0.335, 0.235, 0.055), (0.0, 0.0, 0.075), "robot0_white"),
    _Piece(_WHEELED, _BOX, (0.325, 0.225, 0.008), (0.0, 0.0, 0.012), "robot0_blue"),
    _Piece(_WHEELED, _BOX, (0.350, 0.250, 0.030), (0.0, 0.0, 0.160), "robot0_grey"),
    _Piece(_WHEELED, _CYLINDER, (0.100, 0.020, 0.0), (-0.01, 0.226, -0.090), "robot0_dark", _WHEEL_QUAT),
    _Piece(_WHEELED, _CYLINDER, (0.100, 0.020, 0.0), (-0.01, -0.226, -0.090), "robot0_dark", _WHEEL_QUAT),
    _Piece(_WHEELED, _CYLINDER, (0.045, 0.200, 0.0), (0.26, 0.0, -0.145), "robot0_grey", _WHEEL_QUAT),
    _Piece(_WHEELED, _CYLINDER, (0.045, 0.200, 0.0), (-0.26, 0.0, -0.145), "robot0_grey", _WHEEL_QUAT),
    # The two telescoping tubes: radius and length follow from their inertias.
    _Piece(_COLUMN_LOWER, _CYLINDER, (0.120, 0.195, 0.0), (0.0, 0.0, -0.005), "robot0_dark"),
    _Piece(names.SUPPORT, _CYLINDER, (0.110, 0.195, 0.0), (-0.05, 0.0, -0.205), "robot0_grey"),
    _Piece(names.SUPPORT, _BOX, (0.130, 0.110, 0.010), (-0.04, 0.0, -0.010), "robot0_dark"),
)


def add_shapes(spec: mujoco.MjSpec, quality: str) -> None:
    """Add collision and visual geoms to the bodies of the robot; its mesh assets are already in `spec`."""
    for name, material in _MATERIALS.items():
        added = spec.add_material(name=name, rgba=material.rgba)
        added.specular, added.shininess = material.specular, material.shininess
    suffix = "_full" if quality == "quality" else ""
    for i in range(8):
        _mesh(spec, f"robot0_link{i}", f"robot0_link{i}", suffix, "robot0_white")
    _mesh(spec, names.GRIPPER, "robot0_hand", suffix, "robot0_white", _HAND_MESH_QUAT)
    _fingers(spec, suffix)
    _base(spec)


def _mesh(
    spec: mujoco.MjSpec, body: str, mesh: str, suffix: str, material: str, quat: Quat = IDENTITY, name: str = ""
) -> None:
    name = name or body
    target = spec.body(body)
    target.add_geom(
        name=f"{name}_collision",
        type=_MESH,
        meshname=mesh,
        quat=quat,
        group=COLLISION_GROUP,
        mass=0.0,
        rgba=(0, 0, 0, 0),
    )
    visual = target.add_geom(
        name=f"{name}_visual", type=_MESH, meshname=mesh + suffix, quat=quat, material=material, mass=0.0
    )
    _visual_only(visual)


def _fingers(spec: mujoco.MjSpec, suffix: str) -> None:
    for i, (body, sign, quat) in enumerate((("leftfinger", 1.0, IDENTITY), ("rightfinger", -1.0, _HALF_TURN_Z)), 1):
        name = f"gripper0_right_finger{i}"
        _mesh(spec, f"gripper0_right_{body}", "robot0_finger", suffix, "robot0_grey", quat, name)
        pad = spec.body(f"gripper0_right_finger_joint{i}_tip").add_geom(
            name=names.FINGER_PAD_GEOMS[i - 1], type=_BOX, size=_PAD_SIZE, group=COLLISION_GROUP, mass=0.0
        )
        pad.pos = (_PAD_CENTER[0], sign * _PAD_CENTER[1], _PAD_CENTER[2])
        pad.condim = 4
        pad.friction = _PAD_FRICTION
        pad.solref = (0.01, 0.5)
        pad.rgba = (0.0, 0.0, 0.0, 0.0)


def _base(spec: mujoco.MjSpec) -> None:
    collisions = (
        (_WHEELED, _BOX, (0.35, 0.25, 0.19), (0.0, 0.0, 0.0)),
        (_COLUMN_LOWER, _CYLINDER, (0.12, 0.2, 0.0), (0.0, 0.0, 0.0)),
        (names.SUPPORT, _CYLINDER, (0.1125, 0.2, 0.0), (-0.05, 0.0, -0.2)),
    )
    for body, kind, size, pos in collisions:
        spec.body(body).add_geom(
            name=f"{body}_collision", type=kind, size=size, pos=pos, group=COLLISION_GROUP, mass=0.0, rgba=(0, 0, 0, 0)
        )
    for i, piece in enumerate(_BASE_LOOK):
        geom = spec.body(piece.body).add_geom(
            name=f"mobilebase0_look{i}_visual",
            type=piece.kind,
            size=piece.size,
            pos=piece.pos,
            quat=piece.quat,
            mass=0.0,
        )
        geom.material = piece.material
        _visual_only(geom)


def _visual_only(geom: mujoco.MjsGeom) -> None:
    geom.contype = 0
    geom.conaffinity = 0
    geom.group = VISUAL_GROUP
