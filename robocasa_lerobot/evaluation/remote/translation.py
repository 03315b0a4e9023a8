"""Between our observations and actions and a server's: what a key map says, done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.evaluation.remote.failures import AnswerError
from robocasa_lerobot.evaluation.remote.key_map import ActionKey, CameraKey, KeyMap, path_of
from robocasa_lerobot.evaluation.remote.pictures import resized
from robocasa_lerobot.wire.codec import text_of

_SHOWN = 12


class UnfitEnvError(UserError):
    """What the env shows is not what the key map sends: no trial will get around it."""


def request_of(
    key_map: KeyMap, observations: Sequence[Mapping[str, Any]], instruction: str, seed: int = 0, number: int = 0
) -> dict[str, Any]:
    """The map that a server is sent.

    Args:
        key_map: names, orders and sizes.
        observations: of the env, one for each of `key_map.offsets`, oldest first.
        instruction: what the robot is told.
        seed: of the trial's noise.
        number: of the request in its trial, from 0.

    Raises:
        UnfitEnvError: the env has other cameras, another state or pictures of another size than the map.
    """
    _check_env(key_map, observations[-1])
    at = dict(zip(key_map.offsets, observations, strict=True))
    out: dict[str, Any] = {}
    for name, value in key_map.constants.items():
        _put(out, name, value)
    for one in key_map.cameras:
        frames = [_picture(one, at[offset]["pixels"][one.camera]) for offset in key_map.picture_offsets]
        _put(out, one.key, _with_axes(np.stack(frames), key_map.axes))
    for part in key_map.state:
        states = contract.split_state(np.stack([at[offset]["agent_pos"] for offset in key_map.of_states]))
        joined = np.concatenate([states[name] for name in part.parts], axis=-1).astype(part.dtype)
        _put(out, part.key, _with_axes(joined, key_map.axes))
    if key_map.prompt is not None:
        forms = {"text": instruction, "list": [instruction], "lists": [[instruction]]}
        _put(out, key_map.prompt.key, forms[key_map.prompt.form])
    for key, value in ((key_map.seed, seed), (key_map.number, number)):
        if key is not None:
            _put(out, key, value)
    return out


def actions_of(key_map: KeyMap, answer: Mapping[str, Any]) -> NDArray[np.float32]:
    """The actions (T, 12) in stored order of a server's answer, all that it has.

    Raises:
        AnswerError: an array is missing or has another shape; the text names key, found and expected.
    """
    parts: dict[str, NDArray[np.float32]] = {}
    lengths: dict[str, int] = {}
    for one in key_map.actions:
        array = _array(one, answer, key_map.executed_steps)
        lengths[one.key] = len(array)
        start = one.start
        for name in one.parts:
            size = contract.ACTION_SLICES[name].stop - contract.ACTION_SLICES[name].start
            parts[name] = array[:, start : start + size]
            start += size
    if len(set(lengths.values())) > 1:
        raise AnswerError(f"the answer's arrays have different lengths {lengths}, expected as many actions in each")
    length = min(lengths.values())
    if length < key_map.executed_steps:
        key = next(iter(lengths))
        raise AnswerError(
            f"{key}: found {length} action(s), expected at least {key_map.executed_steps}, which are executed of each "
            f"answer; use --executed_steps={length} or fewer"
        )
    return np.asarray(contract.join_action(parts), dtype=np.float32)


def flat_shapes(message: Mapping[Any, Any], prefix: str = "") -> dict[str, str]:
    """Every entry of a nested map with its type and shape, for errors."""
    out: dict[str, str] = {}
    for key, value in message.items():
        name = prefix + str(text_of(key))
        if isinstance(value, Mapping):
            out |= flat_shapes(value, f"{name} > ")
        elif isinstance(value, np.ndarray):
            out[name] = f"{value.dtype} {tuple(value.shape)}"
        else:
            out[name] = type(value).__name__
    return out


def listed(message: Mapping[Any, Any]) -> str:
    """The entries of a map in a line."""
    shapes = flat_shapes(message)
    shown = ", ".join(f"{name} ({shape})" for name, shape in list(shapes.items())[:_SHOWN])
    return (shown or "nothing") + (f" and {len(shapes) - _SHOWN} more" if len(shapes) > _SHOWN else "")


def _check_env(key_map: KeyMap, observation: Mapping[str, Any]) -> None:
    pixels = observation.get("pixels")
    shown = list(pixels) if isinstance(pixels, Mapping) else []
    for one in key_map.cameras:
        if one.camera not in shown:
            raise UnfitEnvError(
                f"{one.key}: the env shows no picture of {one.camera}, which the key map sends; it has "
                f"{', '.join(shown) or 'none'}. Policies behind a socket are asked about what our kitchens show."
            )
    state = np.asarray(observation.get("agent_pos")).shape
    if key_map.state and state != (contract.STATE_SIZE,):
        raise UnfitEnvError(
            f"{key_map.state[0].key}: the env's agent_pos has shape {state}, expected ({contract.STATE_SIZE},). "
            "Policies behind a socket are asked about what our kitchens show."
        )


def _picture(one: CameraKey, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    if one.size is None:
        return picture
    height, width = one.size
    if one.resize == "none" and picture.shape[:2] != (height, width):
        raise UnfitEnvError(
            f"{one.key}: found pictures of {picture.shape[0]}x{picture.shape[1]}, expected {height}x{width}, and "
            f"`resize: none`; use --env.image_size={height}"
        )
    return resized(picture, (height, width), one.resize)


def _with_axes(array: NDArray[Any], axes: str) -> NDArray[Any]:
    """(T, ...) as the map wants it."""
    return array[0] if axes == "none" else array[None] if axes == "batch_time" else array


def _put(message: dict[str, Any], key: str, value: Any) -> None:
    *outer, last = path_of(key)
    for name in outer:
        message = message.setdefault(name, {})
    message[last] = value


def _array(one: ActionKey, answer: Mapping[str, Any], executed: int) -> NDArray[np.float32]:
    """The array (T, width) of an action key."""
    width = one.width or one.end
    expected = f"numbers of shape (at least {executed}, {width})"
    found: Any = answer
    for name in path_of(one.key):
        inside = {text_of(key): value for key, value in found.items()}
        if name not in inside:
            names = flat_shapes(answer)
            raise AnswerError(
                f"{one.key}: not in the answer, which has {listed(answer)}; expected {expected}. "
                f"{suggest(one.key, names)}"
            )
        found = inside[name]
        if not isinstance(found, Mapping):
            break
    try:
        array = np.asarray(found, dtype=np.float32)
    except (TypeError, ValueError, OverflowError) as error:
        raise AnswerError(f"{one.key}: found a {type(found).__name__}, expected {expected}") from error
    shape = array.shape
    while array.ndim > 2 and array.shape[0] == 1:  # a batch of one
        array = array[0]
    if array.ndim == 1:
        array = array[:, None] if width == 1 else array[None]
    if array.ndim != 2 or array.shape[1] != width:
        raise AnswerError(f"{one.key}: found shape {shape}, expected {expected}")
    return array
