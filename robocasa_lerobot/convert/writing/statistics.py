"""`meta/stats.json` over all frames of a dataset: exact for numbers, over the sampled frames for pictures.

LeRobot 0.6.1 aggregates quantiles as a mean of the episodes' quantiles, which is wrong for every dataset whose
episodes differ; training with quantile normalization would see it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.writing.encoder import QUANTILES, Histogram, num_sampled_pixels, unit_statistics

_ROWS = 65_536  # read at a time
_QUANTILE_NAMES = tuple(f"q{round(q * 100):02d}" for q in QUANTILES)


def column(root: Path, key: str) -> NDArray[Any]:
    """A numeric column (N,) or (N, k) of all data files of a dataset, in file order, with its stored dtype."""
    whole: NDArray[Any] = np.concatenate(list(column_batches(root, key)))
    return whole


def column_batches(root: Path, key: str) -> Iterator[NDArray[Any]]:
    """The same in runs of rows, of which one is in memory at a time."""
    for file in sorted((root / "data").glob("*/*.parquet")):
        for batch in pq.ParquetFile(file).iter_batches(_ROWS, columns=[key]):
            yield column_of(pa.Table.from_batches([batch]), key)


def column_of(table: pa.Table, key: str) -> NDArray[Any]:
    """A numeric column (N,) or (N, k) of an Arrow table with its stored dtype, bit for bit."""
    parts = []
    for array in table[key].chunks:
        nested = pa.types.is_nested(array.type)
        values = (array.flatten() if nested else array).to_numpy(zero_copy_only=False)
        parts.append(values.reshape(len(array), -1) if nested else values)
    return np.concatenate(parts)


def dataset_statistics(
    root: Path, features: Mapping[str, Mapping[str, Any]], histograms: Mapping[str, Histogram]
) -> dict[str, dict[str, NDArray[Any]]]:
    """Statistics of every feature in LeRobot's layout: (k,) for numbers, (3, 1, 1) in [0, 1] for pictures."""
    stats = {}
    for key, feature in features.items():
        if contract.is_picture(feature):
            stats[key] = picture_statistics(histograms[key], feature["shape"])
        elif feature["dtype"] not in ("string", "language"):
            stats[key] = _column_statistics(root, key)
    return stats


def picture_statistics(histogram: Histogram, shape: Sequence[int]) -> dict[str, NDArray[Any]]:
    """Statistics (3, 1, 1) in [0, 1] of the sampled pixels of pictures of `shape` (H, W, 3)."""
    num_frames = int(histogram.sum()) // (3 * num_sampled_pixels(shape[0], shape[1]))
    return unit_statistics(histogram, num_frames)


def _column_statistics(root: Path, key: str) -> dict[str, NDArray[Any]]:
    """Statistics of a column over all frames of a dataset, with one component at a time in memory."""
    files = sorted((root / "data").glob("*/*.parquet"))
    num_rows = sum(pq.read_metadata(file).num_rows for file in files)
    with tempfile.TemporaryFile(dir=root.parent) as scratch:
        components: np.memmap[Any, np.dtype[np.float64]] | None = None
        start = 0
        for batch in column_batches(root, key):
            rows = batch.astype(np.float64).reshape(len(batch), -1)
            if components is None:
                components = np.memmap(scratch, np.float64, "w+", shape=(rows.shape[1], num_rows))
            components[:, start : start + len(rows)] = rows.T
            start += len(rows)
        assert components is not None
        each = [vector_statistics(np.array(component)) for component in components]
    joined = {name: np.concatenate([stats[name] for stats in each]) for name in each[0]}
    return joined | {"count": each[0]["count"]}


def vector_statistics(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """min, max, mean, std, count and quantiles (linear interpolation) over the first axis of (N,) or (N, k)."""
    rows = values.reshape(len(values), -1).astype(np.float64)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": np.array([len(rows)]),
        **dict(zip(_QUANTILE_NAMES, np.quantile(rows, QUANTILES, axis=0), strict=True)),
    }
