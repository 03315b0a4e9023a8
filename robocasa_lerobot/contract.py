"""The one place where names, orders, sizes and rates of the robot interface are written.

Everything else imports them from here; a part that is missing is an error and never filled with zeros.
The conventions are RoboCasa365's (robocasa 1.0.1) and those of LeRobot's own RoboCasa environment, so that
a policy trained on their data runs here and vice versa. All quaternions of observations and
datasets are xyzw with w >= 0; lengths are metres, angles radians, and image arrays are upright HWC uint8 RGB.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robocasa_lerobot.errors import UserError, suggest


class ContractError(UserError):
    """Data that does not have the names, shapes or values that the contract asks for."""


@dataclass(frozen=True)
class Part:
    """A named run of components of a state or action vector."""

    name: str
    components: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.components)


ROBOT_TYPE = "PandaOmron"
CONTROL_HZ = 20
VIDEO_FPS = CONTROL_HZ
PHYSICS_TIMESTEP_S = 0.002
SUBSTEPS = 25  # CONTROL_HZ * SUBSTEPS * PHYSICS_TIMESTEP_S == 1
IMAGE_SIZE = 256  # pixels, height and width
LARGEST_IMAGE_SIZE = 4096  # of pictures that are made or read

CAMERAS: tuple[str, ...] = ("robot0_agentview_left", "robot0_agentview_right", "robot0_eye_in_hand")
STATE_KEY = "observation.state"
ACTION_KEY = "action"
TASK_KEY = "task"
INSTRUCTION_KEY = "annotation.human.task_description"  # of RoboCasa's datasets, its envs, and GR00T
IMAGE_PREFIX = "observation.images."
# Which stage a frame belongs to: its number in the episode, its row in the table of texts, and LeRobot's own column.
STAGE_KEY = "stage_index"
SUBTASK_KEY = "subtask_index"
LANGUAGE_KEY = "language_persistent"
STAGE_KEYS: tuple[str, ...] = (STAGE_KEY, SUBTASK_KEY, LANGUAGE_KEY)
# Who decided each step, where people have a hand in it: HDF5 datasets below an episode, features `extra.<name>` of a
# dataset. Whether a person decided while there was a policy (0, 1); what the policy wanted (12, the order of the file's
# actions); whether the step belongs to a planned motion that the person asked for (0, 1). And what a demonstrator
# wanted before noise came to it (12, as before).
INTERVENTION, POLICY_ACTION, ASSISTED, CLEAN_ACTION = "intervention", "policy_action", "assisted", "clean_action"
DECISIONS: tuple[str, ...] = (INTERVENTION, POLICY_ACTION, ASSISTED, CLEAN_ACTION)
EXTRA_PREFIX = "extra."
FRAME_KINDS: tuple[str, ...] = ("interventions", "autonomous")  # frames by who decided them


def image_key(camera: str) -> str:
    """Dataset feature name of a camera."""
    return IMAGE_PREFIX + camera


def decision_key(name: str) -> str:
    """Dataset feature of one of `DECISIONS`."""
    return EXTRA_PREFIX + name


IMAGE_KEYS: tuple[str, ...] = tuple(image_key(camera) for camera in CAMERAS)

STATE_PARTS: tuple[Part, ...] = (
    Part("base_position", ("base_x", "base_y", "base_z")),
    Part("base_rotation", ("base_qx", "base_qy", "base_qz", "base_qw")),
    Part("end_effector_position_relative", ("eef_x", "eef_y", "eef_z")),
    Part("end_effector_rotation_relative", ("eef_qx", "eef_qy", "eef_qz", "eef_qw")),
    Part("gripper_qpos", ("finger_1", "finger_2")),
)

_BASE_MOTION = Part("base_motion", ("base_forward", "base_left", "base_yaw", "torso"))
_CONTROL_MODE = Part("control_mode", ("control_mode",))
_EEF_POSITION = Part("end_effector_position", ("eef_dx", "eef_dy", "eef_dz"))
_EEF_ROTATION = Part("end_effector_rotation", ("eef_rx", "eef_ry", "eef_rz"))
_GRIPPER = Part("gripper_close", ("gripper_close",))

# Order of the `action` column of LeRobot datasets, of the env's action space and of every policy here.
ACTION_PARTS: tuple[Part, ...] = (_BASE_MOTION, _CONTROL_MODE, _EEF_POSITION, _EEF_ROTATION, _GRIPPER)
# Order of `actions` in RoboCasa and robosuite HDF5 files, and of the low-level controller.
ACTION_PARTS_HDF5: tuple[Part, ...] = (_EEF_POSITION, _EEF_ROTATION, _GRIPPER, _BASE_MOTION, _CONTROL_MODE)

# Parts that are stored as -1 or +1 (a policy may also give 0 and 1); at execution `>= BINARY_THRESHOLD` means +1.
BINARY_PARTS: tuple[str, ...] = ("control_mode", "gripper_close")
BINARY_THRESHOLD = 0.5

# HDF5 observation key of each state part, in robosuite's naming.
STATE_PART_HDF5_KEYS: dict[str, str] = {
    "base_position": "robot0_base_pos",
    "base_rotation": "robot0_base_quat",
    "end_effector_position_relative": "robot0_base_to_eef_pos",
    "end_effector_rotation_relative": "robot0_base_to_eef_quat",
    "gripper_qpos": "robot0_gripper_qpos",
}


def slices(parts: Sequence[Part]) -> dict[str, slice]:
    """Slice of each part in the vector that concatenates `parts`."""
    out, start = {}, 0
    for part in parts:
        out[part.name] = slice(start, start + part.size)
        start += part.size
    return out


def component_names(parts: Sequence[Part]) -> list[str]:
    """Names of the single components, in order."""
    return [component for part in parts for component in part.components]


STATE_SLICES = slices(STATE_PARTS)
ACTION_SLICES = slices(ACTION_PARTS)
ACTION_SLICES_HDF5 = slices(ACTION_PARTS_HDF5)
STATE_SIZE = sum(part.size for part in STATE_PARTS)
ACTION_SIZE = sum(part.size for part in ACTION_PARTS)


def _permutation(source: Mapping[str, slice], target: Sequence[Part]) -> NDArray[np.intp]:
    return np.concatenate([np.arange(source[p.name].start, source[p.name].stop) for p in target])


_HDF5_TO_STORED = _permutation(ACTION_SLICES_HDF5, ACTION_PARTS)
_STORED_TO_HDF5 = _permutation(ACTION_SLICES, ACTION_PARTS_HDF5)
_BINARY = np.concatenate([np.arange(ACTION_SLICES[p].start, ACTION_SLICES[p].stop) for p in BINARY_PARTS])


def hdf5_to_stored(action: ArrayLike) -> NDArray[Any]:
    """Actions of shape (..., 12) in HDF5 order, given in stored order; values and dtype are untouched.

    Raises:
        ContractError: the last axis is not 12 long.
    """
    return _checked(action, ACTION_SIZE, "action in HDF5 order")[..., _HDF5_TO_STORED]


def stored_to_hdf5(action: ArrayLike) -> NDArray[Any]:
    """Actions of shape (..., 12) in stored order, given in HDF5 order; values and dtype are untouched.

    Raises:
        ContractError: the last axis is not 12 long.
    """
    return _checked(action, ACTION_SIZE, "action in stored order")[..., _STORED_TO_HDF5]


def split_state(state: ArrayLike) -> dict[str, NDArray[Any]]:
    """The named parts of states of shape (..., 16)."""
    checked = _checked(state, STATE_SIZE, "state")
    return {name: checked[..., where] for name, where in STATE_SLICES.items()}


def split_action(action: ArrayLike) -> dict[str, NDArray[Any]]:
    """The named parts of actions of shape (..., 12) in stored order."""
    checked = _checked(action, ACTION_SIZE, "action in stored order")
    return {name: checked[..., where] for name, where in ACTION_SLICES.items()}


def join_state(parts: Mapping[str, ArrayLike]) -> NDArray[Any]:
    """State of shape (..., 16) from its named parts, each of shape (..., size).

    Raises:
        ContractError: a part is missing, unknown, or has a wrong size.
    """
    return _join(parts, STATE_PARTS, "state")


def join_action(parts: Mapping[str, ArrayLike]) -> NDArray[Any]:
    """Action of shape (..., 12) in stored order from its named parts, each of shape (..., size).

    Raises:
        ContractError: a part is missing, unknown, or has a wrong size.
    """
    return _join(parts, ACTION_PARTS, "action")


def binarize(action: ArrayLike) -> NDArray[Any]:
    """Actions in stored order with their binary parts set to -1 or +1, as they are executed."""
    out = np.array(_checked(action, ACTION_SIZE, "action in stored order"), copy=True)
    out[..., _BINARY] = np.where(out[..., _BINARY] >= BINARY_THRESHOLD, 1.0, -1.0)
    return out


def canonical_quaternion(quat_xyzw: ArrayLike) -> NDArray[Any]:
    """Quaternions of shape (..., 4), xyzw, with the sign that makes w >= 0 (robosuite's rule)."""
    quat = _checked(quat_xyzw, 4, "quaternion")
    return np.where(quat[..., 3:4] < 0, -quat, quat)


def dataset_features(image_size: tuple[int, int] = (IMAGE_SIZE, IMAGE_SIZE)) -> dict[str, dict[str, Any]]:
    """LeRobotDataset v3.0 features of a PandaOmron dataset; `image_size` is (height, width) in pixels."""
    height, width = image_size
    video = {"dtype": "video", "shape": (height, width, 3), "names": ["height", "width", "channel"]}
    return {
        **{key: dict(video) for key in IMAGE_KEYS},
        STATE_KEY: {"dtype": "float64", "shape": (STATE_SIZE,), "names": component_names(STATE_PARTS)},
        ACTION_KEY: {"dtype": "float64", "shape": (ACTION_SIZE,), "names": component_names(ACTION_PARTS)},
    }


def is_picture(feature: Mapping[str, Any]) -> bool:
    """Whether a feature of a LeRobotDataset's info.json is pictures, of colours or of depth."""
    return feature["dtype"] in ("video", "image")


def is_depth(feature: Mapping[str, Any]) -> bool:
    """Whether a picture feature is declared to hold depth."""
    info = feature.get("info") or feature.get("video_info") or {}
    return bool(info.get("video.is_depth_map") or info.get("is_depth_map")) if isinstance(info, dict) else False


def demo_subset(total: int, count: int, seed: int = 0) -> tuple[int, ...]:
    """Which `count` of `total` demonstrations `<count>_demos` means, ascending; all where there are no more.

    RoboCasa365's own rule (its GR00T dataset class): the episodes in order are shuffled by Python's generator with
    seed 0, and the first `count` taken.
    """
    order = list(range(total))
    random.Random(seed).shuffle(order)
    return tuple(sorted(order[:count]))


def _checked(array: ArrayLike, size: int, what: str) -> NDArray[Any]:
    out = np.asarray(array)
    if out.ndim == 0 or out.shape[-1] != size:
        raise ContractError(f"{what}: found shape {out.shape}, expected (..., {size}).")
    return out


def _join(values: Mapping[str, ArrayLike], parts: Sequence[Part], what: str) -> NDArray[Any]:
    names = [part.name for part in parts]
    for name in values:
        if name not in names:
            raise ContractError(f"{what}: unknown part {name!r}. {suggest(name, names)}")
    missing = [name for name in names if name not in values]
    if missing:
        raise ContractError(f"{what}: missing part(s) {', '.join(missing)}; all of {', '.join(names)} are needed.")
    return np.concatenate([_checked(values[p.name], p.size, f"{what} part {p.name!r}") for p in parts], axis=-1)
