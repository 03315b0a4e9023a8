"""Stages of episodes in a dataset: LeRobot's subtasks, one text for every frame, and the index of the stage itself.

Three columns, for three kinds of readers. `stage_index` counts the stages of the episode (`ep_meta["stages"]`).
`subtask_index` is a row of the dataset's `meta/subtasks.parquet`, which has every text once; loaders of LeRobot 0.5
give it as `item["subtask"]`. `language_persistent` is where LeRobot 0.6 keeps subtasks: in every frame the list of all
texts of the episode with the times from which on they hold, read by `active_at(..., style="subtask")` and recipes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.stages import StageTrack

SUBTASKS_FILE = "meta/subtasks.parquet"
_ROLE, _STYLE = "assistant", "subtask"  # LeRobot's, of a text that a high-level policy would say


def stage_features() -> dict[str, dict[str, Any]]:
    """LeRobot's description of the three columns."""
    number = {"dtype": "int64", "shape": (1,), "names": None}
    return {
        contract.STAGE_KEY: dict(number),
        contract.SUBTASK_KEY: dict(number),
        contract.LANGUAGE_KEY: {"dtype": "language", "shape": (1,), "names": None},
    }


class SubtaskTable:
    """The texts of a dataset's subtasks, each once, by row."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self._rows: dict[str, int] = {}
        self.rows(texts)

    def rows(self, texts: Iterable[str]) -> NDArray[np.int64]:
        """Row of each text; new ones are added at the end."""
        return np.array([self._rows.setdefault(text, len(self._rows)) for text in texts], np.int64)

    def write(self, root: Path) -> None:
        """Write the table of the dataset in `root`; none where it is empty."""
        if self._rows:
            table = pd.DataFrame(
                {contract.SUBTASK_KEY: list(self._rows.values())}, index=pd.Index(list(self._rows), name="subtask")
            )
            table.to_parquet(root / SUBTASKS_FILE)


def read_subtasks(root: Path) -> list[str]:
    """Texts of the subtasks of the dataset in `root`, by row; empty where it has none."""
    if not (root / SUBTASKS_FILE).is_file():
        return []
    table = pq.ParquetFile(root / SUBTASKS_FILE).read()
    texts = next(name for name in ("subtask", "__index_level_0__") if name in table.column_names)
    rows = dict(zip(table[contract.SUBTASK_KEY].to_pylist(), table[texts].to_pylist(), strict=True))
    return [str(rows[row]) for row in sorted(rows)]


def language_column(track: StageTrack, timestamps: NDArray[np.float32], kind: pa.DataType) -> pa.Array:
    """`language_persistent` of an episode: the same list in each of its T frames, of Arrow type `kind`."""
    changes = track.changes()
    row = kind.value_type
    fields = {
        "role": pa.array([_ROLE] * len(changes), row.field("role").type),
        "content": pa.array([track.texts[track.index[at]] for at in changes], row.field("content").type),
        "style": pa.array([_STYLE] * len(changes), row.field("style").type),
        "timestamp": pa.array([timestamps[at] for at in changes], row.field("timestamp").type),
    }
    arrays = [
        fields[field.name] if field.name in fields else pa.nulls(len(changes), field.type)
        for field in (row.field(i) for i in range(row.num_fields))
    ]
    rows = pa.StructArray.from_arrays(arrays, fields=[row.field(i) for i in range(row.num_fields)])
    length = len(track.index)
    repeated = rows.take(pa.array(np.tile(np.arange(len(changes)), length)))
    return pa.ListArray.from_arrays(pa.array(np.arange(length + 1) * len(changes), pa.int32()), repeated, type=kind)


def active_texts(column: Sequence[list[dict[str, Any]]], timestamps: NDArray[np.float32]) -> list[str | None]:
    """The subtask's text that holds in each frame, as LeRobot resolves it from `language_persistent`."""
    texts: list[str | None] = []
    for rows, time in zip(column, timestamps, strict=True):
        begun = [row for row in rows if row["style"] == _STYLE and np.float32(row["timestamp"]) <= time]
        texts.append(max(begun, key=lambda row: float(row["timestamp"]))["content"] if begun else None)
    return texts
