"""What preparing finds out about a demonstration, and how it lies in a file: `datagen_info`, in MimicGen's layout.

`eef_pose`, `target_pose`, `gripper_action`, `object_poses/<name>`, `subtask_term_signals/<name>`, `base_pos` and
`base_rot` are MimicGen's and RoboCasa's, hand poses there with the axes of the grip site; what lies under `kitchen/` is
ours.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.generate.sources.transform import heading, make_pose, yaw_pose
from robocasa_lerobot.demos.motion import Array

GROUP = "datagen_info"
OURS = "kitchen"
VERSION = 5  # of this layout: files of another one are prepared again
INTERFACE, INTERFACE_TYPE = "MG_KitchenEnv", "robocasa_lerobot"
# The hand body's axes in those of the grip site, which MimicGen's poses have: a quarter turn about the approach.
HAND_IN_SITE = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
_SERIES = ("joints", "touching", "contact_points", "undersides", "working_points")


@dataclass(frozen=True)
class Prepared:
    """A demonstration of T steps; entry t is the state before action t.

    Attributes:
        eef: (T, 4, 4) pose of the hand: grip site, axes of the hand body.
        target: (T, 4, 4) pose that the controller leads the hand to from step t on, in the world as the base stood.
        gripper: (T,) command, -1 opens.
        base: (T, 3) of the base centre: x, y in metres, heading in radians.
        stage: (T,) number of the stage.
        gap: (T,) between the fingers, metres.
        poses: (T, 4, 4) of each object and part, of fixtures, which stand still, by their roles, and of where a stage
            uses what is held, by `uses.use_key`.
        joints: (T,) position of each part's joint, metres or radians.
        touching: (T,) of each object and part what of it the hand touches: 0 nothing, 1 its handle, 2 the rest.
        contact_points: (T, 3) of each part, the middle of what is touched, in its axes, metres.
        undersides: (T, 3) of each object, the point below its origin at the height of its underside, metres.
        working_points: (T, 3) of each stage that uses what is held, the point of it that counts, in its axes, metres.
        about: what else is known: `stages`, `parts`, `objects`, `fixtures`.
    """

    eef: Array
    target: Array
    gripper: Array
    base: Array
    stage: NDArray[np.int64]
    gap: Array
    poses: dict[str, Array]
    joints: dict[str, Array]
    touching: dict[str, NDArray[np.int64]]
    contact_points: dict[str, Array]
    undersides: dict[str, Array]
    working_points: dict[str, Array]
    about: dict[str, Any]

    def __len__(self) -> int:
        return len(self.eef)

    def base_pose(self, step: int) -> Array:
        """The base centre at a step as a pose (4, 4) on the floor."""
        x, y, yaw = self.base[step].tolist()
        return yaw_pose(x, y, yaw)


def write_prepared(demo: h5py.Group, found: Prepared, signals: dict[str, NDArray[np.int64]]) -> None:
    """Write a demonstration's `datagen_info`, with the signals (T,) at which its subtasks end."""
    group = demo.create_group(GROUP)
    group.attrs.update({"env_interface_name": INTERFACE, "env_interface_type": INTERFACE_TYPE, "version": VERSION})
    group.attrs["about"] = json.dumps(found.about)
    upright = np.array([found.base_pose(step) for step in range(len(found))]).reshape(-1, 4, 4)
    arrays: dict[str, NDArray[Any]] = {
        "eef_pose": found.eef @ HAND_IN_SITE.T,
        "target_pose": found.target @ HAND_IN_SITE.T,
        "gripper_action": found.gripper[:, None],
        "base_pos": upright[:, :3, 3],
        "base_rot": upright[:, :3, :3],
        **{f"object_poses/{name}": poses for name, poses in found.poses.items()},
        **{f"subtask_term_signals/{name}": values for name, values in signals.items()},
        f"{OURS}/gap": found.gap,
        f"{OURS}/stage": found.stage,
    }
    for series in _SERIES:
        arrays |= {f"{OURS}/{series}/{name}": values for name, values in getattr(found, series).items()}
    for key, values in arrays.items():
        group.create_dataset(key, data=values, compression="gzip")
    for key in ("object_poses", "subtask_term_signals"):
        group.require_group(key)


def read_prepared(group: h5py.Group) -> Prepared:
    """Read what `write_prepared` wrote, from the group `datagen_info`."""
    ours = group[OURS]
    turns, places = group["base_rot"][()], group["base_pos"][()]
    yaws = [heading(turn) for turn in turns]
    return Prepared(
        eef=group["eef_pose"][()] @ HAND_IN_SITE,
        target=group["target_pose"][()] @ HAND_IN_SITE,
        gripper=group["gripper_action"][()][:, 0],
        base=np.column_stack([places[:, :2], yaws]),
        stage=ours["stage"][()],
        gap=ours["gap"][()],
        poses={name: values[()] for name, values in group["object_poses"].items()},
        about=json.loads(group.attrs["about"]),
        **{series: {k: v[()] for k, v in ours[series].items()} if series in ours else {} for series in _SERIES},
    )


def is_prepared(demo: h5py.Group) -> bool:
    """Whether a demonstration has a `datagen_info` of this version."""
    return GROUP in demo and int(demo[GROUP].attrs.get("version", 0)) == VERSION


def world_pose(position: Array, rotation: Array) -> Array:
    """A pose (4, 4) from MuJoCo's flat arrays."""
    return make_pose(position, rotation.reshape(3, 3))
