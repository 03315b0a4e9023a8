"""`meta/stats.json` over all frames of a dataset: exact for numbers, over the sampled frames for pictures.

LeRobot 0.6.1 aggregates quantiles as a mean of the episodes' quantiles, which is wrong for every dataset whose
episodes differ; training with quantile normalization would see it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot.convert.encoder import QUANTILES, Histogram, histogram_statistics


def column(root: Path, key: str) -> NDArray[Any]:
    """A numeric column (N,) or (N, k) of all data files of a dataset, in file order, with its stored dtype."""
    tables = [pq.read_table(file, columns=[key]) for file in sorted((root / "data").glob("*/*.parquet"))]
    return column_of(pa.concat_tables(tables), key)


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
        if feature["dtype"] in ("video", "image"):
            num_frames = int(histograms[key].sum()) // int(np.prod(feature["shape"]))
            levels = histogram_statistics(histograms[key], num_frames)
            stats[key] = {
                name: value if name == "count" else (value / 255).reshape(3, 1, 1) for name, value in levels.items()
            }
        elif feature["dtype"] != "string":
            stats[key] = vector_statistics(column(root, key))
    return stats


def vector_statistics(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """min, max, mean, std, count and quantiles (linear interpolation) over the first axis of (N,) or (N, k)."""
    rows = values.reshape(len(values), -1).astype(np.float64)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": np.array([len(rows)]),
        **{f"q{round(q * 100):02d}": np.quantile(rows, q, axis=0) for q in QUANTILES},
    }
