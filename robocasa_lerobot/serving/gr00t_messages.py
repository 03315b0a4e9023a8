"""GR00T's observations taken apart into rows, its modality config, and its actions by part."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.serving.observations import flatten
from robocasa_lerobot.serving.policy import Served
from robocasa_lerobot.serving.request import RequestError

_UNBATCHED = {"video": 4, "state": 2}  # axes of an array (T, ...) without a batch


@dataclass(frozen=True)
class Rows:
    """The observations of a batch. `batched`: answers have the axis too; `nested`: their keys have no `action.`."""

    maps: list[dict[str, Any]]
    batched: bool
    nested: bool


def rows_of(observation: Any, most: int) -> Rows:
    """A batch (B, T, ...) as B observations of T steps, one without that axis as one.

    Raises:
        RequestError: rows of different numbers, or more than `most`.
    """
    flat = flatten(observation)
    nested = any(isinstance(value, Mapping) for value in observation.values())
    arrays = {key: value for key, value in flat.items() if isinstance(value, np.ndarray)}
    sizes = {key: len(value) for key, value in arrays.items() if value.ndim > _UNBATCHED.get(key.partition(".")[0], 9)}
    if not sizes:
        return Rows([flat], batched=False, nested=nested)
    count = next(iter(sizes.values()))
    modal = [key for key in arrays if key.partition(".")[0] in _UNBATCHED]
    if set(sizes.values()) != {count} or set(modal) != set(sizes):
        raise RequestError(f"observation: found batches of {sizes}, expected (B, T, ...) of all with the same B.")
    if not 1 <= count <= most:
        raise RequestError(f"observation: found a batch of {count}, expected 1 to {most}.")
    return Rows([{key: _row(value, i, count, key in sizes) for key, value in flat.items()} for i in range(count)],
                batched=True, nested=nested)  # fmt: skip


def _row(value: Any, index: int, count: int, batched: bool) -> Any:
    if batched:
        return value[index]
    per_row = isinstance(value, list | tuple) and len(value) == count
    return value[index] if per_row else value


def to_actions(chunks: Sequence[NDArray[np.float32]], rows: Rows) -> dict[str, NDArray[np.float32]]:
    """Actions (T, 12) in stored order of each row, by part: (B, T, size), or (T, size) without a batch."""
    stacked = np.stack(list(chunks)) if rows.batched else chunks[0]
    prefix = "" if rows.nested else "action."
    return {prefix + name: np.ascontiguousarray(part) for name, part in contract.split_action(stacked).items()}


def modality_config(served: Served, version: str) -> dict[str, Any]:
    """What the policy takes and gives: keys and offsets in control steps, as that version's clients read it."""
    history = list(served.offsets)
    keys: dict[str, tuple[list[int], Sequence[str]]] = {
        "video": (history, served.cameras),
        "state": (history, [part.name for part in contract.STATE_PARTS]),
        "action": (list(range(served.executed)), [part.name for part in contract.ACTION_PARTS]),
        "language": ([0], [contract.INSTRUCTION_KEY]),
    }
    out: dict[str, Any] = {}
    for modality, (offsets, names) in keys.items():
        prefix = f"{modality}." if version == "1.5" and modality != "language" else ""
        config = {"delta_indices": offsets, "modality_keys": [prefix + name for name in names]}
        as_json = json.dumps(config) if version == "1.5" else config
        out[modality] = {"__ModalityConfig_class__": True, "as_json": as_json}
    return out
