"""Observations as clients name them, read into the env's own form.

Three families of names are understood, told apart by the state:

- ours and LeRobot's: `observation.images.<camera>`, `observation.state` (16 in stored order), `task`; or the env's
  `pixels`, `agent_pos`. Actions go back in stored order.
- those of RoboCasa365's GR00T fork and gym wrapper: `video.<camera>`, `state.<part>`,
  `annotation.human.task_description`, also nested and with the names of GR00T N1.6's base checkpoint.
- those of RoboCasa365's openpi forks: `observation/image`, `observation/wrist_image`, `observation/right_image`,
  `observation/state` (16: end effector, base, gripper), `prompt`.

For the last two, flat actions are in HDF5 order, which is what these clients execute.
Sources: RoboCasa365's openpi fork at 43fd9da and its pi0.5 head, Isaac-GR00T N1.5 and N1.6, robocasa 1.0.1, vla-eval
0.8.0's RoboCasa365 benchmark.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import suggest
from robocasa_lerobot.evaluation.actors.actor import Observation
from robocasa_lerobot.serving.request import RequestError
from robocasa_lerobot.wire.codec import text_of

LEFT, RIGHT, WRIST = contract.CAMERAS
# What other peers call the cameras, beside the contract's names; after `video.`, `images.` or nothing.
_OTHER_CAMERAS: Final[dict[str, tuple[str, ...]]] = {
    LEFT: ("res256_image_side_0", "left_view"),
    RIGHT: ("res256_image_side_1", "right_view"),
    WRIST: ("res256_image_wrist_0", "wrist_view"),
}
_OPENPI_CAMERAS: Final[dict[str, tuple[str, ...]]] = {
    LEFT: ("observation/image",),
    RIGHT: ("observation/right_image", "observation/image2", "observation/extra_view_image"),
    WRIST: ("observation/wrist_image",),
}
_CAMERA_PREFIXES: Final = (contract.IMAGE_PREFIX, "pixels.", "video.", "images.", "images.video.")
_STATE_PREFIXES: Final = ("state.", "state.state.")
_OWN_STATE: Final = (contract.STATE_KEY, "agent_pos")
_OPENPI_STATE: Final = "observation/state"
_OPENPI_STATE_PARTS: Final = (
    "end_effector_position_relative",
    "end_effector_rotation_relative",
    "base_position",
    "base_rotation",
    "gripper_qpos",
)
_INSTRUCTIONS: Final = (
    *("prompt", contract.TASK_KEY, "task_description", "instruction"),
    *(contract.INSTRUCTION_KEY, "annotation.human.action.task_description"),
    *(f"language.{contract.INSTRUCTION_KEY}", "language.annotation.human.action.task_description"),
)
_MAX_INSTRUCTION: Final = 4096  # characters


@dataclass(frozen=True)
class Asked:
    """What a client's observation says: those at the policy's offsets, and how it wants its actions.

    `stored_order`: flat actions are wanted in stored order, else in HDF5 order.
    """

    observations: tuple[Observation, ...]
    instruction: str
    stored_order: bool


@dataclass(frozen=True)
class Wanted:
    """What a policy needs: cameras and their (height, width), and observations at which control steps, up to 0.

    `resize`: pictures of another size are scaled. `repeat`: one observation may stand for all of the history.
    """

    cameras: tuple[str, ...]
    image_size: tuple[int, int] | None
    offsets: tuple[int, ...]
    resize: bool = False
    repeat: bool = False


def read_observation(message: Any, wanted: Wanted) -> Asked:
    """The observations in a client's map.

    Pictures are uint8 (H, W, 3), upright RGB, or (T, H, W, 3) at the policy's T offsets, oldest first; states (16,) or
    (T, 16).

    Raises:
        RequestError: a key is missing, or has another type, shape or values than the policy can use.
    """
    flat = flatten(message)
    state, stored_order = _read_state(flat)
    pictures = {camera: _read_pictures(flat, camera) for camera in wanted.cameras}
    steps = {"state": len(state), **{camera: len(values) for camera, values in pictures.items()}}
    if len(set(steps.values())) > 1:
        raise RequestError(f"observation: found {steps} steps of its parts, expected as many of each.")
    state, pictures = _with_history(state, pictures, wanted)
    pictures = {camera: _of_size(values, camera, wanted) for camera, values in pictures.items()}
    observations = tuple(
        {"pixels": {camera: values[t] for camera, values in pictures.items()}, "agent_pos": state[t]}
        for t in range(len(state))
    )
    return Asked(observations, _read_instruction(flat), stored_order)


def flatten(message: Any, depth: int = 4) -> dict[str, Any]:
    """A map whose maps inside are joined with dots: `{"video": {"left": x}}` is `{"video.left": x}`.

    Raises:
        RequestError: not a map of text keys.
    """
    if not isinstance(message, Mapping):
        raise RequestError(f"observation: found {_what(message)}, expected a map.")
    out: dict[str, Any] = {}
    for key, value in message.items():
        name = text_of(key)
        if not isinstance(name, str):
            raise RequestError(f"observation: found the key {name!r:.60}, expected text.")
        if isinstance(value, Mapping):
            if depth == 0:
                raise RequestError(f"observation: {name!r:.60} is nested too deeply.")
            out |= {f"{name}.{inner}": one for inner, one in flatten(value, depth - 1).items()}
        else:
            out[name] = value
    return out


def _read_state(flat: Mapping[str, Any]) -> tuple[NDArray[np.float64], bool]:
    """States (T, 16) in stored order, and whether the client names things as we do."""
    for key in _OWN_STATE:
        if key in flat:
            return _numbers(flat[key], key, contract.STATE_SIZE), True
    parts: dict[str, NDArray[np.float64]] = {}
    for part in contract.STATE_PARTS:
        for key in (prefix + part.name for prefix in _STATE_PREFIXES):
            if key in flat:
                parts[part.name] = _numbers(flat[key], key, part.size)
    if parts:
        missing = [part.name for part in contract.STATE_PARTS if part.name not in parts]
        if missing:
            raise RequestError(f"state.{missing[0]}: not in the observation, which has {_listed(flat)}.")
        if len({len(values) for values in parts.values()}) > 1:
            raise RequestError(f"state: found parts of {[len(v) for v in parts.values()]} steps, expected equal ones.")
        return contract.join_state(parts), False
    if _OPENPI_STATE not in flat:
        known = (*_OWN_STATE, _OPENPI_STATE, *(f"state.{part.name}" for part in contract.STATE_PARTS))
        near = next((suggest(key, known) for key in flat if "state" in key), f"Expected one of {', '.join(known)}.")
        raise RequestError(f"state: not in the observation, which has {_listed(flat)}. {near}")
    sizes = {part.name: part.size for part in contract.STATE_PARTS}
    values = _numbers(flat[_OPENPI_STATE], _OPENPI_STATE, contract.STATE_SIZE)
    ends = np.cumsum([sizes[name] for name in _OPENPI_STATE_PARTS])[:-1]
    split = np.split(values, ends, axis=-1)
    return contract.join_state(dict(zip(_OPENPI_STATE_PARTS, split, strict=True))), False


def _numbers(value: Any, key: str, size: int) -> NDArray[np.float64]:
    """Finite numbers (T, size)."""
    if isinstance(value, list | tuple) and all(isinstance(x, int | float) for x in value):
        value = np.array(value, dtype=np.float64)
    if not isinstance(value, np.ndarray) or value.ndim not in (1, 2) or value.shape[-1] != size or not value.size:
        raise RequestError(f"{key}: found {_what(value)}, expected numbers of shape ({size},) or (T, {size}).")
    numbers: NDArray[np.float64] = np.atleast_2d(value.astype(np.float64))
    if not np.isfinite(numbers).all():
        raise RequestError(f"{key}: found numbers that are not finite.")
    return numbers


def camera_keys(camera: str) -> tuple[str, ...]:
    """All keys under which a camera's pictures are looked for, ours first."""
    names = (camera, *_OTHER_CAMERAS[camera])
    return tuple(prefix + name for prefix in _CAMERA_PREFIXES for name in names) + _OPENPI_CAMERAS[camera]


def _read_pictures(flat: Mapping[str, Any], camera: str) -> NDArray[np.uint8]:
    """Pictures (T, H, W, 3)."""
    key = next((key for key in camera_keys(camera) if key in flat), None)
    if key is None:
        expected = ", ".join((contract.image_key(camera), f"video.{camera}", *_OPENPI_CAMERAS[camera]))
        raise RequestError(
            f"{camera}: no picture of it in the observation, which has {_listed(flat)}; expected one of {expected}."
        )
    value = flat[key]
    if not isinstance(value, np.ndarray) or value.dtype != np.uint8 or value.ndim not in (3, 4):
        raise RequestError(f"{key}: found {_what(value)}, expected a uint8 array of shape (H, W, 3) or (T, H, W, 3).")
    if value.shape[-1] != 3 or 0 in value.shape:
        raise RequestError(f"{key}: found shape {value.shape}, expected (H, W, 3) or (T, H, W, 3), channels last.")
    return value if value.ndim == 4 else value[None]


def _with_history(
    state: NDArray[np.float64], pictures: dict[str, NDArray[np.uint8]], wanted: Wanted
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.uint8]]]:
    found, times = len(state), len(wanted.offsets)
    if found == times:
        return state, pictures
    if found == 1 and wanted.repeat:
        return np.repeat(state, times, 0), {camera: np.repeat(one, times, 0) for camera, one in pictures.items()}
    raise RequestError(
        f"observation: found {found} step(s), expected those at the control steps {list(wanted.offsets)}, oldest "
        f"first: pictures (T, H, W, 3) and states (T, {contract.STATE_SIZE}) with T = {times}; before a trial's start "
        "its first observation counts. (`serve --repeat-history` takes one for all, at the cost of a policy that "
        "believes it stands still.)"
    )


def _of_size(pictures: NDArray[np.uint8], camera: str, wanted: Wanted) -> NDArray[np.uint8]:
    size = pictures.shape[1:3]
    if wanted.image_size is None or size == wanted.image_size:
        return pictures
    height, width = wanted.image_size
    if not wanted.resize:
        raise RequestError(
            f"{camera}: found pictures of {size[0]}x{size[1]}, expected {height}x{width}, at which the policy was "
            "trained. (`serve --resize` scales them.)"
        )
    from PIL import Image

    box = Image.Resampling.BOX if size[0] >= height and size[1] >= width else Image.Resampling.BILINEAR
    scaled = [np.asarray(Image.fromarray(one).resize((width, height), box)) for one in pictures]
    return np.stack(scaled)


def _read_instruction(flat: Mapping[str, Any]) -> str:
    key = next((key for key in _INSTRUCTIONS if key in flat), None)
    if key is None:
        raise RequestError(
            f"instruction: not in the observation, which has {_listed(flat)}; expected one of "
            f"{', '.join(_INSTRUCTIONS)}."
        )
    value = flat[key]
    while isinstance(value, Sequence) and not isinstance(value, str | bytes) and len(value) == 1:
        value = value[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if not isinstance(value, str) or len(value) > _MAX_INSTRUCTION:
        raise RequestError(f"{key}: found {_what(value)}, expected text of at most {_MAX_INSTRUCTION} characters.")
    return value


def _listed(flat: Mapping[str, Any]) -> str:
    names = sorted(flat)
    shown = ", ".join(f"{name:.60}" for name in names[:12])
    return (shown or "no keys") + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def _what(value: Any) -> str:
    """A value in a few words."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and dtype {value.dtype}"
    if isinstance(value, str):
        return f"text of {len(value)} characters"
    return f"a {type(value).__name__}"
