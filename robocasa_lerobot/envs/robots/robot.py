"""What a robot is to everything else: names, home, shape, gripper, cameras, and what builds and drives it.

A robot is one value of `Robot`, made in a folder of its own. No number of its hand, base or fingers stands elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robocasa_lerobot.envs.robots.camera_noise import CameraNoise
from robocasa_lerobot.envs.robots.cameras import CameraSpec
from robocasa_lerobot.errors import UnknownNameError

Array = NDArray[np.float64]


class Controller(Protocol):
    """From a 12-D action per control step to actuator commands per physics step; its memory is one vector."""

    def reset(self) -> None:
        """Forget all goals and hold the present pose."""

    def set_action(self, action: ArrayLike) -> None:
        """Take the action (12,) of a control step, in HDF5 order."""

    def run(self, substeps: int = ...) -> bool:
        """Control and advance the physics; whether what sleeps must be evaluated anew."""

    def goal_in_base(self) -> tuple[Array, Array]:
        """Goal position (3,) metres and rotation (3, 3) of the grip site in the arm's base frame."""

    def arm_frame(self) -> tuple[Array, Array]:
        """Position (3,) metres and axes (3, 3) of that frame in the world, as commands are taken relative to it."""

    def get_state(self) -> Array:
        """A copy of its memory."""

    def set_state(self, state: ArrayLike) -> None:
        """Restore what `get_state` returned."""


@dataclass(frozen=True)
class RobotNames:
    """What a robot's parts are called in a model; those of recorded files.

    Attributes:
        base: body that holds everything; mobile_base: what drives; support: carries the arm and the scene's cameras.
        hand: body of the end effector; gripper: body that carries the fingers.
        base_joints: two slides and a hinge; torso_joint, arm_joints, finger_joints.
        base_center_site: the base pose of observations; arm_center_site: the frame that arm commands are given in.
        grip_site: between the finger tips, the end effector's position.
    """

    base: str
    mobile_base: str
    support: str
    hand: str
    gripper: str
    base_joints: tuple[str, str, str]
    torso_joint: str
    arm_joints: tuple[str, ...]
    finger_joints: tuple[str, ...]
    base_center_site: str
    arm_center_site: str
    grip_site: str

    @property
    def joints(self) -> tuple[str, ...]:
        """All joints in the order of the model, and so of its entries in qpos and qvel."""
        return (*self.base_joints, self.torso_joint, *self.arm_joints, *self.finger_joints)


@dataclass(frozen=True)
class HomePose:
    """Joint values at the start of an episode: radians, metres of each finger, metres of the torso."""

    arm: tuple[float, ...]
    gripper: tuple[float, ...]
    torso: float


@dataclass(frozen=True)
class StandingShape:
    """What a standing robot takes up, in the frame of its base centre with x forward, metres.

    Attributes:
        standoff: of the base centre from the front edge of the counter that it faces.
        base_x, base_y, base_top: bounds of the mobile base, and its height.
        column_half, column_top: half size of the column above it, and the height below which obstacles count for it.
        hand_x, hand_half, hand_z: forearm and hand in the home pose: bounds before the base, half width, heights.
        yaw_pivot: where the joint turns the base.
    """

    standoff: float
    base_x: tuple[float, float]
    base_y: tuple[float, float]
    base_top: float
    column_half: float
    column_top: float
    hand_x: tuple[float, float]
    hand_half: float
    hand_z: tuple[float, float]
    yaw_pivot: tuple[float, float]


@dataclass(frozen=True)
class GripperGeometry:
    """A parallel gripper, metres; the hand's z is the approach, its fingers open along y.

    Attributes:
        opening: the widest object that it is sent to grasp.
        tips_below_grip: how far the finger tips reach beyond the grip site, with room for what is uneven.
        pad_corner: half width of the pads along x, and how far they reach beyond the grip site: what is lowest of a
            hand that is tipped over the line between its fingers.
        palm_above_grip: nothing may be higher than this above the grip site.
        finger_inner, finger_outer: of an open finger, from the middle.
        finger_half_width: along the hand's x.
        palm_half: half size of the palm along x and y.
        closed_half: half size of both fingers, closed, along x, y and z: what touches when they push.
    """

    opening: float
    tips_below_grip: float
    pad_corner: tuple[float, float]
    palm_above_grip: float
    finger_inner: float
    finger_outer: float
    finger_half_width: float
    palm_half: tuple[float, float]
    closed_half: tuple[float, float, float]

    def closed_reach(self, rotation: Array, direction: Array) -> float:
        """How far the closed fingers reach from the grip site in a direction (3,), turned so (3, 3), metres."""
        return float(np.array(self.closed_half) @ np.abs(rotation.T @ direction))


@dataclass(frozen=True)
class ArmReach:
    """How far an arm reaches, metres: the wrist behind the grip site, the shoulder's height, wrist to shoulder.

    `stretched` is the elbow's angle at which wrist and shoulder are farthest apart, radians; it bends to angles below.
    """

    wrist_behind_grip: float
    shoulder: float
    longest: float
    stretched: float


@dataclass(frozen=True)
class Robot:
    """A robot as a value.

    Attributes:
        name: of the robot.
        names: of its parts.
        home, shape, gripper, reach: see there.
        camera_sets: its cameras, by name of the set; camera_noise: what stands for noise on them if none is given.
        build: puts its bodies, joints, actuators, sites, cameras and shapes into a spec: (spec, quality, cameras).
        controller: makes what drives it: (model, data).
        read_state: the contract's state (16,): (model, data), positions and velocities evaluated.
        read_observations: proprioception under robosuite's names, likewise.
    """

    name: str
    names: RobotNames
    home: HomePose
    shape: StandingShape
    gripper: GripperGeometry
    reach: ArmReach
    camera_sets: Mapping[str, tuple[CameraSpec, ...]]
    camera_noise: Mapping[str, CameraNoise]
    build: Callable[[mujoco.MjSpec, str, Sequence[CameraSpec]], None]
    controller: Callable[[mujoco.MjModel, mujoco.MjData], Controller]
    read_state: Callable[[mujoco.MjModel, mujoco.MjData], Array]
    read_observations: Callable[[mujoco.MjModel, mujoco.MjData], dict[str, Array]]

    def cameras(self, camera_set: str) -> tuple[CameraSpec, ...]:
        """The cameras of a set.

        Raises:
            UnknownNameError: there is no camera set of that name.
        """
        if camera_set not in self.camera_sets:
            raise UnknownNameError("camera set", camera_set, self.camera_sets)
        return self.camera_sets[camera_set]

    def add_to(self, spec: mujoco.MjSpec, quality: str, camera_set: str = "default") -> None:
        """Add the robot to the world of `spec`; `quality` ("fast", "quality") chooses the look only.

        Raises:
            UnknownNameError: there is no such quality or camera set.
        """
        self.build(spec, quality, self.cameras(camera_set))

    def place_base(self, model: mujoco.MjModel, data: mujoco.MjData, x: float, y: float, yaw: float) -> None:
        """Set the base joints so that the base centre stands at world (x, y) metres with heading `yaw` radians.

        Writes `data.qpos` only (call `mj_forward` afterwards); the torso keeps its height.
        """
        spawn = model.body(self.names.base).pos
        cos, sin = np.cos(yaw), np.sin(yaw)
        pivot_x, pivot_y = self.shape.yaw_pivot
        # The hinge turns the base about its pivot, which moves the base centre; the slides make up for that.
        slide_x = x - spawn[0] - pivot_x + cos * pivot_x - sin * pivot_y
        slide_y = y - spawn[1] - pivot_y + sin * pivot_x + cos * pivot_y
        for joint, value in zip(self.names.base_joints, (slide_x, slide_y, yaw), strict=True):
            data.joint(joint).qpos[0] = value

    def set_home(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        rng: np.random.Generator | None = None,
        noise_std: float = 0.02,
    ) -> None:
        """Set arm, gripper and torso to their home pose, at rest; the base stays where it is.

        With `rng`, Gaussian noise of `noise_std` radians is added to the arm joints, unclipped, as RoboCasa does.
        Writes `data.qpos` and the robot's `data.qvel` only (call `mj_forward` afterwards).
        """
        arm: Array = np.array(self.home.arm)
        if rng is not None:
            arm += rng.normal(0.0, noise_std, size=arm.shape)
        values = dict(zip(self.names.arm_joints, arm, strict=True))
        values |= dict(zip(self.names.finger_joints, self.home.gripper, strict=True))
        values[self.names.torso_joint] = self.home.torso
        for joint, value in values.items():
            data.joint(joint).qpos[0] = value
        for joint in self.names.joints:
            data.joint(joint).qvel[0] = 0.0
