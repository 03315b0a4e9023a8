"""Kinematic tree, masses, inertias and joints of the PandaOmron: numbers only, no geometry.

Source of every number: the compiled PandaOmron of robosuite as RoboCasa 1.0.1 uses it. Lengths in metres, masses in
kilograms, inertias in kg m^2, quaternions wxyz, angles in radians; positions are in the parent's frame, centres of
mass and joint anchors in the body's own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from robocasa_lerobot.envs.robots.cameras import Quat, Vec3
from robocasa_lerobot.envs.robots.panda_omron import names

IDENTITY: Quat = (1.0, 0.0, 0.0, 0.0)
_QUARTER = 0.707107  # as the source writes it: sqrt(1/2) to six digits


@dataclass(frozen=True)
class JointSpec:
    """A slide or hinge; `range` is None where it is unlimited."""

    name: str
    kind: str  # "slide" or "hinge"
    axis: Vec3
    range: tuple[float, float] | None
    frictionloss: float = 0.0
    damping: float = 0.0
    armature: float = 0.0
    anchor: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class BodySpec:
    """A rigid body with its explicit inertial frame (mass 0 means: no inertia of its own)."""

    name: str
    parent: str  # "" is the world
    pos: Vec3
    quat: Quat = IDENTITY
    mass: float = 0.0
    com: Vec3 = (0.0, 0.0, 0.0)
    inertia_quat: Quat = IDENTITY
    inertia: Vec3 = (0.0, 0.0, 0.0)
    joints: tuple[JointSpec, ...] = field(default=())


BASE_YAW_PIVOT: Vec3 = (-0.21, 0.0, 0.0)  # in the mobile base's frame: midway between its driven wheels

_BASE_JOINTS = (
    # The axes are those of robosuite >= 1.5.2 (forward is x); 1.5.1 has the two exchanged.
    JointSpec(names.BASE_JOINTS[0], "slide", (1.0, 0.0, 0.0), None, frictionloss=250.0),
    JointSpec(names.BASE_JOINTS[1], "slide", (0.0, 1.0, 0.0), None, frictionloss=250.0),
    JointSpec(names.BASE_JOINTS[2], "hinge", (0.0, 0.0, 1.0), None, frictionloss=250.0, anchor=BASE_YAW_PIVOT),
)
_TORSO_JOINT = JointSpec(names.TORSO_JOINT, "slide", (0.0, 0.0, 1.0), (0.0, 0.34), frictionloss=1000.0, damping=0.01)
_ARM_RANGES = (
    (-2.8973, 2.8973),
    (-1.7628, 1.7628),
    (-2.8973, 2.8973),
    (-3.0718, -0.0698),
    (-2.8973, 2.8973),
    (-0.0175, 3.7525),
    (-2.8973, 2.8973),
)


def _arm_joint(number: int) -> JointSpec:
    return JointSpec(
        names.ARM_JOINTS[number - 1],
        "hinge",
        (0.0, 0.0, 1.0),
        _ARM_RANGES[number - 1],
        frictionloss=0.1,
        damping=0.1 if number <= 5 else 0.01,
        armature=5.0 / number,
    )


def _finger_joint(name: str, limits: tuple[float, float]) -> JointSpec:
    return JointSpec(name, "slide", (0.0, 1.0, 0.0), limits, frictionloss=1.0, damping=100.0, armature=1.0)


def _link(number: int, pos: Vec3, quat: Quat, mass: float, com: Vec3, inertia: float) -> BodySpec:
    joints = (_arm_joint(number),) if number else ()
    parent = f"robot0_link{number - 1}" if number else names.SUPPORT
    return BodySpec(f"robot0_link{number}", parent, pos, quat, mass, com, IDENTITY, (inertia,) * 3, joints)


_X_MINUS: Quat = (_QUARTER, -_QUARTER, 0.0, 0.0)
_X_PLUS: Quat = (_QUARTER, _QUARTER, 0.0, 0.0)
_Z_PLUS: Quat = (_QUARTER, 0.0, 0.0, _QUARTER)
_Z_MINUS: Quat = (_QUARTER, 0.0, 0.0, -_QUARTER)


def _finger(side: str, joint: str, limits: tuple[float, float]) -> BodySpec:
    return BodySpec(
        f"gripper0_right_{side}finger",
        names.GRIPPER,
        (0.0, 0.0, 0.0524),
        _Z_PLUS,
        mass=0.1,
        com=(0.0, 0.0, 0.05),
        inertia=(0.01, 0.01, 0.005),
        joints=(_finger_joint(joint, limits),),
    )


def _tip(number: int, side: str, y: float) -> BodySpec:
    return BodySpec(
        f"gripper0_right_finger_joint{number}_tip",
        f"gripper0_right_{side}finger",
        (0.0, y, 0.056),
        mass=0.01,
        inertia_quat=(0.0, 0.0, 0.0, 1.0),
        inertia=(0.01, 0.01, 0.01),
    )


BODIES: tuple[BodySpec, ...] = (
    BodySpec(names.ROBOT_BASE, "", (0.0, 0.0, 0.0)),
    BodySpec(names.MOBILE_BASE, names.ROBOT_BASE, (0.0, 0.0, 0.0), joints=_BASE_JOINTS),
    BodySpec(
        "mobilebase0_fixed_support",
        names.MOBILE_BASE,
        (-0.05, 0.0, 0.5),
        mass=18.095574,
        inertia=(0.30641838, 0.30641838, 0.13028813),
    ),
    BodySpec(
        names.SUPPORT,
        "mobilebase0_fixed_support",
        (0.05, 0.0, 0.2),
        mass=15.904313,
        com=(-0.05, 0.0, -0.2),
        inertia=(0.26237974, 0.26237974, 0.10064448),
        joints=(_TORSO_JOINT,),
    ),
    _link(0, (0.0, 0.0, 0.0), IDENTITY, 4.0, (0.0, 0.0, 0.05), 0.4),
    _link(1, (0.0, 0.0, 0.333), IDENTITY, 3.0, (0.0, 0.0, -0.07), 0.3),
    _link(2, (0.0, 0.0, 0.0), _X_MINUS, 3.0, (0.0, -0.1, 0.0), 0.3),
    _link(3, (0.0, -0.316, 0.0), _X_PLUS, 2.0, (0.04, 0.0, -0.05), 0.2),
    _link(4, (0.0825, 0.0, 0.0), _X_PLUS, 2.0, (-0.04, 0.05, 0.0), 0.2),
    _link(5, (-0.0825, 0.384, 0.0), _X_MINUS, 2.0, (0.0, 0.0, -0.15), 0.2),
    _link(6, (0.0, 0.0, 0.0), _X_PLUS, 1.5, (0.06, 0.0, 0.0), 0.1),
    _link(7, (0.088, 0.0, 0.0), _X_PLUS, 0.5, (0.0, 0.0, 0.08), 0.05),
    BodySpec(
        names.HAND,
        "robot0_link7",
        (0.0, 0.0, 0.1065),
        (0.923785, 0.0, 0.0, -0.382911),
        mass=0.5,
        inertia=(0.05, 0.05, 0.05),
    ),
    BodySpec(
        names.GRIPPER,
        names.HAND,
        (0.0, 0.0, 0.0),
        _Z_MINUS,
        mass=0.3,
        com=(0.0, 0.0, 0.17),
        inertia_quat=_X_PLUS,
        inertia=(0.09, 0.07, 0.05),
    ),
    BodySpec("gripper0_right_eef", names.GRIPPER, (0.0, 0.0, 0.097), com=(0.0, 0.0, 0.097)),
    _finger("left", names.FINGER_JOINTS[0], (0.0, 0.04)),
    _tip(1, "left", 0.0085),
    _finger("right", names.FINGER_JOINTS[1], (-0.04, 0.0)),
    _tip(2, "right", -0.0085),
    BodySpec(
        "mobilebase0_wheeled_base",
        names.MOBILE_BASE,
        (-0.2, 0.0, 0.192),
        mass=1.33,
        inertia=(0.04371267, 0.07031267, 0.08201667),
    ),
)
