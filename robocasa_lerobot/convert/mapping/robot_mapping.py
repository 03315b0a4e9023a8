"""How a robot's recorded numbers become the `observation.state` and `action` columns: chosen by what a file holds.

Adding a robot: write a function in `robots.py` that returns a `RobotMapping` or None and put it into `RECOGNITIONS`;
or describe it in a mapping file (`custom_mapping.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.reading.demo import Demo, RejectedEpisodeError

# Features of extra columns. LeRobot's policies take every feature that begins with `observation` or `action` for an
# input or output; these begin with neither.
EXTRA_PREFIX = contract.EXTRA_PREFIX


class Poses(Protocol):
    """What a mapping asks a replayed scene for."""

    def site_pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """World position (3,) and rotation matrix (3, 3) of a site."""

    def body_rotation(self, name: str) -> NDArray[np.float64]:
        """World rotation matrix (3, 3) of a body."""

    def joint_positions(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Positions (n,) of joints."""


@dataclass(frozen=True)
class Columns:
    """Components `start` to `stop` of an HDF5 dataset (T, width) below an episode, or the same numbers at each step."""

    key: str
    width: int
    start: int
    stop: int
    constant: tuple[float, ...] = ()


@dataclass(frozen=True)
class Arm:
    """Names of one arm in robosuite's composed models and observations.

    `name` is what its parts begin with, empty for the only arm. `grip_site` is empty where the scene has none, and
    `joints` are those of the gripper.
    """

    name: str
    observations: str
    hand_body: str
    grip_site: str
    joints: tuple[str, ...]


@dataclass(frozen=True)
class RobotMapping:
    """Names and sources of the state and action components of one kind of robot.

    `state_columns` and `action_columns` give the source of each part; `arms` and `base_site` are used where the file
    has no observations and the state is computed from the scene. `base_site` is empty for robots with a fixed base.
    `unit_commands` says that actions go to robosuite's controllers, where 1 is a full command.
    """

    robot_type: str
    state_parts: tuple[Part, ...]
    action_parts: tuple[Part, ...]
    state_columns: tuple[Columns, ...]
    action_columns: tuple[Columns, ...]
    default_cameras: tuple[str, ...]
    arms: tuple[Arm, ...] = ()
    base_site: str = ""
    extra_columns: tuple[Columns, ...] = ()
    unit_commands: bool = False

    @property
    def action_size(self) -> int:
        """Number of action components."""
        return sum(part.size for part in self.action_parts)

    def actions(self, demo: Demo) -> NDArray[np.float64]:
        """Actions (T, A) in stored order.

        Raises:
            RejectedEpisodeError: a column is missing or has not the width that this robot's has.
        """
        first = next(columns.width for columns in self.action_columns if columns.key == demo.layout.action_key)
        if demo.actions.shape[1] != first:
            raise RejectedEpisodeError(
                f"its {demo.layout.action_key} have {demo.actions.shape[1]} numbers, expected {first} for "
                f"{self.robot_type}."
            )
        return np.concatenate([_needed(demo, columns) for columns in self.action_columns], axis=1)

    def recorded_states(self, demo: Demo) -> NDArray[np.float64] | None:
        """States (T, S) bit for bit from the file, or None where it lacks any part of them and they can be computed.

        Raises:
            RejectedEpisodeError: a column has not the width that this robot's has, or is missing and nothing is known
                of how to compute it.
        """
        if self.arms and any(
            demo.column(columns.key) is None for columns in self.state_columns if not columns.constant
        ):
            return None
        return np.concatenate([_needed(demo, columns) for columns in self.state_columns], axis=1)

    def extras(self, demo: Demo) -> dict[str, NDArray[np.float64]]:
        """Values (T, k) of the extra columns by feature name.

        Raises:
            RejectedEpisodeError: one is missing or has another width.
        """
        return {extra_feature(columns.key): _needed(demo, columns) for columns in self.extra_columns}

    def state_of_scene(self, scene: Poses) -> NDArray[np.float64]:
        """State (S,) of the scene as it is now, with robosuite's definitions of the same names."""
        values: list[NDArray[np.float64]] = []
        position: NDArray[np.float64] = np.zeros(3)
        rotation: NDArray[np.float64] = np.eye(3)
        if self.base_site:
            position, rotation = scene.site_pose(self.base_site)
            values += [position, quaternion_xyzw(rotation)]
        for arm in self.arms:
            grip, _ = scene.site_pose(arm.grip_site)
            hand = scene.body_rotation(arm.hand_body)
            if self.base_site:
                grip, hand = rotation.T @ (grip - position), rotation.T @ hand
            values += [grip, quaternion_xyzw(hand), scene.joint_positions(arm.joints)]
        return np.concatenate(values)

    def features(self, cameras: Mapping[str, tuple[int, int]]) -> dict[str, dict[str, Any]]:
        """LeRobotDataset features; `cameras` gives height and width of each camera in pixels."""
        video = {
            contract.image_key(camera): {"dtype": "video", "shape": (*size, 3), "names": ["height", "width", "channel"]}
            for camera, size in cameras.items()
        }
        vectors = {contract.STATE_KEY: self.state_parts, contract.ACTION_KEY: self.action_parts}
        extras = {
            extra_feature(columns.key): {"dtype": "float64", "shape": (columns.width,), "names": None}
            for columns in self.extra_columns
        }
        return (
            video
            | {
                key: {
                    "dtype": "float64",
                    "shape": (sum(p.size for p in parts),),
                    "names": contract.component_names(parts),
                }
                for key, parts in vectors.items()
            }
            | extras
        )


def extra_feature(key: str) -> str:
    """Dataset feature of an extra column: `extra.obs.robot0_joint_pos` of `obs/robot0_joint_pos`."""
    return EXTRA_PREFIX + key.replace("/", ".")


def _needed(demo: Demo, columns: Columns) -> NDArray[np.float64]:
    if columns.constant:
        return np.tile(np.asarray(columns.constant, np.float64), (demo.length, 1))
    values = demo.column(columns.key)
    if values is None:
        raise RejectedEpisodeError(f"it has no dataset {columns.key!r}.")
    if values.shape[1] != columns.width:
        raise RejectedEpisodeError(f"its {columns.key} is {values.shape}, expected (T, {columns.width}).")
    return values[:, columns.start : columns.stop]


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
