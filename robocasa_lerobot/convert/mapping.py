"""How a robot's recorded numbers become the `observation.state` and `action` columns: chosen by what a file holds.

Adding a robot: write a function that returns a `RobotMapping` or None and put it into `_CHOICES`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.mjcf import SceneNames, scene_names
from robocasa_lerobot.convert.source import Demo, DemoFile, RejectedEpisodeError, SourceError

# Site and body names of robosuite's composed models. The end effector's rotation is that of the hand's body, not of
# the grip site, which differs by a constant turn about its z axis (facts of robosuite 1.4 and 1.5).
BASE_SITE = "mobilebase0_center"
HAND_BODY = "robot0_right_hand"
GRIP_SITES = ("gripper0_right_grip_site", "gripper0_grip_site")  # robosuite >= 1.5, older
GRIPPER_PREFIX = "gripper0_"
# Cameras of fixed-base arms in the order in which they are taken when the user names none.
ONE_ARM_CAMERAS = ("agentview", "robot0_eye_in_hand", "frontview", "sideview", "birdview")
NUM_DEFAULT_CAMERAS = 3
_OSC_POSE_SIZE = 7


class Poses(Protocol):
    """What a mapping asks a replayed scene for."""

    def site_pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """World position (3,) and rotation matrix (3, 3) of a site."""

    def body_rotation(self, name: str) -> NDArray[np.float64]:
        """World rotation matrix (3, 3) of a body."""

    def joint_positions(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Positions (n,) of joints."""


@dataclass(frozen=True)
class RobotMapping:
    """Names and sources of the state and action components of one kind of robot.

    `state_keys` gives the HDF5 observation of each state part; `gripper_joints` and `grip_site` are used where the
    file has no observations and the state is computed from the scene.
    """

    robot_type: str
    state_parts: tuple[Part, ...]
    action_parts: tuple[Part, ...]
    state_keys: tuple[tuple[str, str], ...]
    default_cameras: tuple[str, ...]
    mobile_base: bool
    grip_site: str
    gripper_joints: tuple[str, ...]

    @property
    def action_size(self) -> int:
        """Number of action components."""
        return sum(part.size for part in self.action_parts)

    def actions(self, demo: Demo) -> NDArray[np.float64]:
        """Actions (T, A) in stored order.

        Raises:
            RejectedEpisodeError: A is not that of this robot.
        """
        actions = demo.actions
        if actions.shape[1] != self.action_size:
            raise RejectedEpisodeError(
                f"its actions have {actions.shape[1]} numbers, expected {self.action_size} for {self.robot_type}."
            )
        return contract.hdf5_to_stored(actions) if self.mobile_base else actions

    def recorded_states(self, demo: Demo) -> NDArray[np.float64] | None:
        """States (T, S) bit for bit from the file's observations, or None where the file lacks any part of them."""
        columns = {part: demo.observation(key) for part, key in self.state_keys}
        if any(column is None for column in columns.values()):
            return None
        for part in self.state_parts:
            column = columns[part.name]
            if column is None or column.shape[1] != part.size:
                shape = None if column is None else column.shape
                raise RejectedEpisodeError(
                    f"its {dict(self.state_keys)[part.name]} is {shape}, expected (T, {part.size})."
                )
        return np.concatenate([columns[part.name] for part in self.state_parts], axis=1)

    def state_of_scene(self, scene: Poses) -> NDArray[np.float64]:
        """State (S,) of the scene as it is now, with robosuite's definitions of the same names."""
        grip_position, _ = scene.site_pose(self.grip_site)
        hand = scene.body_rotation(HAND_BODY)
        fingers = scene.joint_positions(self.gripper_joints)
        if not self.mobile_base:
            return np.concatenate([grip_position, quaternion_xyzw(hand), fingers])
        base_position, base = scene.site_pose(BASE_SITE)
        return np.concatenate(
            [
                base_position,
                quaternion_xyzw(base),
                base.T @ (grip_position - base_position),
                quaternion_xyzw(base.T @ hand),
                fingers,
            ]
        )

    def features(self, cameras: Mapping[str, tuple[int, int]]) -> dict[str, dict[str, Any]]:
        """LeRobotDataset features; `cameras` gives height and width of each camera in pixels."""
        video = {
            contract.image_key(camera): {"dtype": "video", "shape": (*size, 3), "names": ["height", "width", "channel"]}
            for camera, size in cameras.items()
        }
        vectors = {contract.STATE_KEY: self.state_parts, contract.ACTION_KEY: self.action_parts}
        return video | {
            key: {"dtype": "float64", "shape": (sum(p.size for p in parts),), "names": contract.component_names(parts)}
            for key, parts in vectors.items()
        }


def choose_mapping(file: DemoFile, demo: Demo) -> RobotMapping:
    """The mapping for the robot of a file, judged by one of its demos.

    Raises:
        SourceError: the robot is none of the known kinds.
    """
    names = scene_names(demo.model_xml) if demo.model_xml else SceneNames((), frozenset(), frozenset(), ())
    for choice in _CHOICES:
        mapping = choice(file, demo, names)
        if mapping is not None:
            return mapping
    raise SourceError(
        f"{file.path}: no mapping fits its robot ({demo.actions.shape[1]}-D actions, robots "
        f"{file.environment.get('robots')!r}). Known: {contract.ROBOT_TYPE} ({contract.ACTION_SIZE}-D actions, "
        f"{', '.join(contract.STATE_PART_HDF5_KEYS.values())} or the site {BASE_SITE}) and one-arm robosuite robots "
        f"(robot0_eef_pos, robot0_eef_quat, robot0_gripper_qpos or the body {HAND_BODY} and a site {GRIP_SITES[0]})."
    )


def _panda_omron(file: DemoFile, demo: Demo, names: SceneNames) -> RobotMapping | None:
    if demo.actions.shape[1] != contract.ACTION_SIZE:
        return None
    keys = tuple(contract.STATE_PART_HDF5_KEYS.items())
    grip_site = next((site for site in GRIP_SITES if site in names.sites), GRIP_SITES[0])
    recorded = all(key in demo.observation_keys for _, key in keys)
    if not recorded and not ({BASE_SITE, grip_site} <= names.sites and HAND_BODY in names.bodies):
        return None
    return RobotMapping(
        robot_type=contract.ROBOT_TYPE,
        state_parts=contract.STATE_PARTS,
        action_parts=contract.ACTION_PARTS,
        state_keys=keys,
        default_cameras=contract.CAMERAS,
        mobile_base=True,
        grip_site=grip_site,
        gripper_joints=tuple(joint for joint in names.joints if joint.startswith(GRIPPER_PREFIX)),
    )


def _one_arm(file: DemoFile, demo: Demo, names: SceneNames) -> RobotMapping | None:
    keys = (
        ("end_effector_position", "robot0_eef_pos"),
        ("end_effector_rotation", "robot0_eef_quat"),
        ("gripper_qpos", "robot0_gripper_qpos"),
    )
    if any(name.startswith("robot1_") for name in (*names.bodies, *demo.observation_keys)):
        return None  # two arms
    grip_site = next((site for site in GRIP_SITES if site in names.sites), "")
    fingers = tuple(joint for joint in names.joints if joint.startswith(GRIPPER_PREFIX))
    gripper = demo.observation("robot0_gripper_qpos")
    recorded = gripper is not None and all(key in demo.observation_keys for _, key in keys)
    if recorded:
        assert gripper is not None
        num_fingers = gripper.shape[1]
    elif grip_site and HAND_BODY in names.bodies:
        num_fingers = len(fingers)
    else:
        return None
    robots = file.environment.get("robots")
    robot = robots[0] if isinstance(robots, list) and robots else robots
    stored, in_scene = demo.image_cameras, names.cameras
    return RobotMapping(
        robot_type=robot if isinstance(robot, str) else "unknown",
        state_parts=(
            Part("end_effector_position", ("eef_x", "eef_y", "eef_z")),
            Part("end_effector_rotation", ("eef_qx", "eef_qy", "eef_qz", "eef_qw")),
            Part("gripper_qpos", tuple(f"finger_{i + 1}" for i in range(num_fingers))),
        ),
        action_parts=_one_arm_actions(file, demo.actions.shape[1]),
        state_keys=keys,
        default_cameras=_default_cameras(stored or in_scene),
        mobile_base=False,
        grip_site=grip_site,
        gripper_joints=fingers,
    )


def _one_arm_actions(file: DemoFile, size: int) -> tuple[Part, ...]:
    controller = str(file.environment.get("controller_configs", ""))
    if size == _OSC_POSE_SIZE and re.search(r"OSC_POSE", controller):
        return (
            Part("end_effector_position", ("eef_dx", "eef_dy", "eef_dz")),
            Part("end_effector_rotation", ("eef_rx", "eef_ry", "eef_rz")),
            Part("gripper_close", ("gripper_close",)),
        )
    return (Part("action", tuple(f"action_{i}" for i in range(size))),)  # another controller: no meaning is known


def _default_cameras(available: Sequence[str]) -> tuple[str, ...]:
    known = [camera for camera in ONE_ARM_CAMERAS if camera in available]
    others = [camera for camera in available if camera not in known]
    return tuple([*known, *others][:NUM_DEFAULT_CAMERAS])


_CHOICES = (_panda_omron, _one_arm)


def quaternion_xyzw(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternion xyzw with w >= 0 of a rotation matrix (3, 3).

    The quaternion is the eigenvector for the largest eigenvalue of a symmetric 4x4 matrix made of the entries of
    the rotation (Bar-Itzhack, 2000), which needs no case distinction and is accurate for every rotation.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    symmetric = np.array(
        [
            [xx - yy - zz, xy + yx, xz + zx, zy - yz],
            [xy + yx, yy - xx - zz, yz + zy, xz - zx],
            [xz + zx, yz + zy, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    _, vectors = np.linalg.eigh(symmetric)
    return contract.canonical_quaternion(vectors[:, -1])
