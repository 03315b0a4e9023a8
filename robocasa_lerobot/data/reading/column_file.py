"""The numbers of a dataset as one memory-mapped file, for mixtures whose states and actions do not fit in memory.

Rows are frames and hold all columns, so that the values of a sample lie together. The system keeps pages used often
in its own cache, and takes that memory back when something else needs it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot.data.reading.cache_disk import check_disk
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import written_aside
from robocasa_lerobot.jobs.locks import locked

FORMAT = 1  # counted up when the content changes
_ROWS = 65_536  # read at a time


def column_types(features: Mapping[str, Mapping[str, Any]]) -> np.dtype[Any]:
    """A row of all numeric columns: floats as float32, integers and booleans as int64."""
    fields: list[tuple[str, type, tuple[int, ...]]] = []
    for name, feature in features.items():
        dtype = str(feature["dtype"])
        if not dtype.startswith(("float", "int", "uint", "bool")):
            continue
        shape = tuple(int(n) for n in feature["shape"])
        kind = np.float32 if dtype.startswith("float") else np.int64
        fields.append((name, kind, () if shape == (1,) else shape))
    return np.dtype(fields)


def read_columns(root: Path, row: np.dtype[Any], total: int) -> dict[str, NDArray[Any]]:
    """Every column of a dataset in memory: (frames, ...)."""
    assert row.names is not None
    out = {name: np.empty((total, *row[name].shape), row[name].base) for name in row.names}
    for start, part in _parts(root, row, total):
        for name, values in part.items():
            out[name][start : start + len(values)] = values
    return out


def map_columns(root: Path, row: np.dtype[Any], total: int, fingerprint: str, folder: Path) -> dict[str, NDArray[Any]]:
    """Every column of a dataset as a view of its memory-mapped file in `folder`, which is made if not there yet.

    Raises:
        UserError: too little free disk for it, or frames are missing.
    """
    assert row.names is not None
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{root.name}_{fingerprint[:16]}_{FORMAT}.npy"
    with locked(path.with_suffix(".lock"), wait=True):
        if not path.is_file():
            check_disk(total * row.itemsize, folder, "the cache of states and actions", "")
            with written_aside(path) as aside:
                rows = np.lib.format.open_memmap(aside, mode="w+", dtype=row, shape=(total,))
                for start, part in _parts(root, row, total):
                    for name, values in part.items():
                        rows[name][start : start + len(values)] = values
                rows.flush()
                del rows
    mapped = np.load(path, mmap_mode="r")
    return {name: mapped[name] for name in row.names}


def _parts(root: Path, row: np.dtype[Any], total: int) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """(first frame, columns) of consecutive parts of the dataset, checked to be complete and in order."""
    assert row.names is not None
    at = 0
    for path in sorted((root / "data").glob("*/*.parquet")):
        for batch in _batches(path, list(row.names)):
            part = {name: _array(batch.column(name), row[name].shape) for name in row.names}
            count = batch.num_rows
            if at + count > total or not np.array_equal(part["index"], np.arange(at, at + count)):
                raise UserError(f"{root}: frames are missing or out of order; convert the dataset again.")
            yield at, part
            at += count
    if at != total:
        raise UserError(f"{root}: frames are missing or out of order; convert the dataset again.")


def _batches(path: Path, names: list[str]) -> Iterator[pa.RecordBatch]:
    try:
        with pq.ParquetFile(path) as file:
            yield from file.iter_batches(_ROWS, columns=names)
    except pa.ArrowException as error:  # a file that was cut off, or one without these columns
        raise UserError(f"{path}: cannot be read: {error} Get or convert the dataset again.") from error


def _array(column: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    values = column
    while hasattr(values, "flatten") and hasattr(values.type, "value_type"):
        values = values.flatten()
    out: NDArray[Any] = values.to_numpy(zero_copy_only=False).reshape(len(column), *shape)
    return out
