"""`meta/modality.json`: what the components of the vectors are called, for GR00T's loaders.

Layout as in RoboCasa's and Isaac-GR00T's datasets: for each part of `state` and `action` the column it is in and its
slice, for each camera its column, and the column that holds the instruction's row in the table of tasks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part

MODALITY_FILE = "meta/modality.json"
INSTRUCTION = "human.task_description"


def modality(
    features: Mapping[str, Mapping[str, Any]], state_parts: Sequence[Part], action_parts: Sequence[Part]
) -> dict[str, Any]:
    """The content of the file; a vector whose parts are not known is one part of its whole length."""
    vectors = {}
    for kind, key, parts in (
        ("state", contract.STATE_KEY, state_parts),
        ("action", contract.ACTION_KEY, action_parts),
    ):
        if key in features:
            size = int(features[key]["shape"][0])
            known = contract.slices(parts) if sum(part.size for part in parts) == size else {kind: slice(0, size)}
            vectors[kind] = {
                name: {"original_key": key, "start": where.start, "end": where.stop} for name, where in known.items()
            }
    cameras = [key for key, feature in features.items() if contract.is_picture(feature)]
    # RoboCasa's datasets have a column of their own.
    column = contract.INSTRUCTION_KEY if contract.INSTRUCTION_KEY in features else "task_index"
    return vectors | {
        "video": {key.removeprefix(contract.IMAGE_PREFIX): {"original_key": key} for key in cameras},
        "annotation": {INSTRUCTION: {"original_key": column}},
    }


def write_modality(root: Path, content: Mapping[str, Any]) -> None:
    """Write the file of a dataset."""
    (root / MODALITY_FILE).write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")


def read_modality(root: Path) -> dict[str, Any]:
    """The file of a dataset, empty where it has none."""
    file = root / MODALITY_FILE
    content = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    return content if isinstance(content, dict) else {}
