"""Key maps made from what a server says about itself: GR00T's modality configuration, our own server's metadata."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.evaluation.remote.address import GR00T, VLA_EVAL
from robocasa_lerobot.evaluation.remote.gr00t import N15
from robocasa_lerobot.evaluation.remote.key_map import ActionKey, CameraKey, KeyMap, PromptKey, StateKey, load_key_map

OURS = "ours"
_SERVER = "robocasa_lerobot"  # what our own server calls itself
_LEFT, _RIGHT, _WRIST = contract.CAMERAS
# Words that a server's name of a camera has: RoboCasa's names, those of N1.6's base checkpoint, those of RLDX.
_CAMERA_WORDS = {
    _LEFT: ("agentview_left", "side_0", "left_view"),
    _RIGHT: ("agentview_right", "side_1", "right_view"),
    _WRIST: ("eye_in_hand", "wrist"),
}
_GROUPS = ("video", "state", "action", "language")
_EXECUTED = 8  # of a chunk, as GR00T's rollouts from N1.6 on do; those of N1.5's fork execute all


def is_ours(metadata: Mapping[str, Any]) -> bool:
    """Whether our own server said this about itself."""
    return metadata.get("server") == _SERVER


def map_of_ours(metadata: Mapping[str, Any], protocol: str) -> KeyMap:
    """The map for our own server, from the preset and what the server says.

    Over vla_eval the server puts histories and chunks together itself; over gr00t names are GR00T's.

    Raises:
        UserError: the server says nothing of the kind.
    """
    if not is_ours(metadata):
        raise UserError(f"key map {OURS}: the server does not say that it is {_SERVER}'s; found {sorted(metadata)}.")
    try:
        found = maps_of_modality_config(metadata)[0] if protocol == GR00T else load_key_map(OURS)
        size = metadata["image_size"]
        seeds = "options > {}" if protocol == GR00T and metadata["gr00t_version"] != N15 else "{}"
        key_map = dataclasses.replace(
            found,
            about=f"made from what {_SERVER}'s server says",
            cameras=[
                dataclasses.replace(one, size=list(size) if size else None, resize="none")
                for one in found.cameras
                if one.camera in metadata["cameras"]
            ],
            state=[dataclasses.replace(one, dtype="float64") for one in found.state],
            image_size=int(size[0]) if size else found.image_size,
            executed_steps=int(metadata["executed_steps"]),
            picture_offsets=[int(offset) for offset in metadata["history_offsets"]],
            state_offsets=None,
            seed=seeds.format("seed") if "seed" in metadata["accepts"] else None,
            number=seeds.format("number") if "number" in metadata["accepts"] else None,
        )
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise UserError(f"key map {OURS}: the server's metadata does not do ({error!r}): {dict(metadata)}") from error
    if protocol == VLA_EVAL:
        return dataclasses.replace(key_map, executed_steps=1, picture_offsets=[0], axes="none", number=None)
    return key_map


def maps_of_modality_config(metadata: Mapping[str, Any]) -> list[KeyMap]:
    """The maps that fit GR00T's modality configuration, in the order in which they are to be tried.

    N1.5 takes flat keys; later services maps of maps, or flat ones where they run with the wrapper for simulators.

    Raises:
        UserError: the service tells no configuration, or names something in it that we cannot name.
    """
    config = metadata.get("modality_config") or {}
    groups = {name: config[name] for name in _GROUPS if isinstance(config.get(name), Mapping)}
    if set(groups) != set(_GROUPS):
        raise UserError(
            f"key map auto: the modality configuration of the server has {sorted(config) or 'nothing'}, expected "
            f"{', '.join(_GROUPS)}; choose a preset or write a key map (--policy.keys)."
        )
    try:
        keys = {name: [str(key) for key in group["modality_keys"]] for name, group in groups.items()}
        offsets = {name: [int(i) for i in group["delta_indices"]] for name, group in groups.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(
            f"key map auto: the server's modality configuration cannot be read ({error!r}): {groups}. Choose a preset "
            "or write a key map (--policy.keys)."
        ) from error
    if metadata.get("gr00t_version") == N15:
        return [_map(keys, offsets, nested=False, executed=len(offsets["action"]))]
    executed = min(_EXECUTED, len(offsets["action"]))
    return [_map(keys, offsets, nested, executed) for nested in (True, False)]


def _map(keys: Mapping[str, list[str]], offsets: Mapping[str, list[int]], nested: bool, executed: int) -> KeyMap:
    def key(group: str, name: str) -> str:
        bare = name.removeprefix(f"{group}.")
        if nested:
            return bare if group == "action" else f"{group} > {bare}"
        return bare if group == "language" else f"{group}.{bare}"

    states = {part.name: part.name for part in contract.STATE_PARTS}
    actions = {part.name: part.name for part in contract.ACTION_PARTS}
    language = keys["language"][:1]
    return KeyMap(
        about="made from the server's modality configuration",
        protocol="gr00t",
        cameras=[
            CameraKey(key("video", name), _camera_of(name), [contract.IMAGE_SIZE, contract.IMAGE_SIZE])
            for name in keys["video"]
        ],
        state=[StateKey(key("state", n), [_named(n, "state", states)]) for n in keys["state"]],
        prompt=PromptKey(key("language", language[0]), "lists" if nested else "list") if language else None,
        actions=[ActionKey(key("action", n), [_named(n, "action", actions)]) for n in keys["action"]],
        executed_steps=executed,
        picture_offsets=offsets["video"],
        state_offsets=offsets["state"],
        axes="batch_time",
    )


def _camera_of(name: str) -> str:
    found = [camera for camera, words in _CAMERA_WORDS.items() if any(word in name for word in words)]
    if len(found) != 1:
        known = [word for words in _CAMERA_WORDS.values() for word in words]
        raise UserError(
            f"key map auto: the server wants the picture {name!r}, which names none of our cameras "
            f"({', '.join(contract.CAMERAS)}). {suggest(name, known)} Write a key map (--policy.keys=FILE)."
        )
    return found[0]


def _named(name: str, group: str, known: Mapping[str, str]) -> str:
    bare = name.removeprefix(f"{group}.")
    if bare not in known:
        raise UserError(
            f"key map auto: the server's {group} has {name!r}, expected one of {', '.join(known)}. "
            f"{suggest(bare, known)} Write a key map (--policy.keys=FILE)."
        )
    return known[bare]
