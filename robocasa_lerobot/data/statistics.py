"""Statistics of a mixture's frames in LeRobot's format, each frame weighted by how often the mixture draws it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot.data.source import DatasetSource
from robocasa_lerobot.errors import UserError

Statistics = dict[str, dict[str, NDArray[Any]]]
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
BOOKKEEPING = ("timestamp", "frame_index", "episode_index", "index", "task_index")


def pooled_statistics(
    sources: Sequence[DatasetSource], episodes: Sequence[NDArray[np.int64]], probabilities: NDArray[np.float64]
) -> Statistics:
    """Statistics over the given episodes of the given datasets, `probabilities[i]` being the share of dataset i.

    Numbers: mean and standard deviation (population) of all frames by weight, exact extremes, and quantiles of
    all frames by weight (inverse of the distribution function), each of shape (dim,). Images: mean, standard
    deviation and extremes pooled from the statistics that the dataset holds for each episode, shape (3, 1, 1),
    values in [0, 1]; they have no quantiles, because those of a union do not follow from those of its parts.

    Raises:
        UserError: a dataset has no statistics of its images.
    """
    frames = [_frame_indices(source, chosen) for source, chosen in zip(sources, episodes, strict=True)]
    weights = np.concatenate([np.full(len(f), p / len(f)) for f, p in zip(frames, probabilities, strict=True)])
    out: Statistics = {}
    for key, feature in sources[0].features.items():
        if key in BOOKKEEPING:
            continue
        if feature["dtype"] in ("video", "image"):
            out[key] = _image_statistics(key, sources, episodes, probabilities)
        elif key in sources[0].columns:
            values = np.concatenate([s.columns[key][f] for s, f in zip(sources, frames, strict=True)])
            out[key] = _weighted_statistics(values.reshape(len(values), -1).astype(np.float64), weights)
    return out


def _frame_indices(source: DatasetSource, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([np.arange(source.starts[e], source.ends[e]) for e in episodes])


def _weighted_statistics(values: NDArray[np.float64], weights: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    mean = weights @ values
    out = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": mean,
        "std": np.sqrt(weights @ (values - mean) ** 2),
        "count": np.array([len(values)]),
    }
    for name, level in QUANTILES.items():
        columns = [np.quantile(v, level, weights=weights, method="inverted_cdf") for v in values.T]
        out[name] = np.array(columns)
    return out


def _image_statistics(
    key: str,
    sources: Sequence[DatasetSource],
    episodes: Sequence[NDArray[np.int64]],
    probabilities: NDArray[np.float64],
) -> dict[str, NDArray[Any]]:
    per_part: dict[str, list[NDArray[Any]]] = {name: [] for name in ("min", "max", "mean", "std")}
    weights: list[NDArray[Any]] = []
    for source, chosen, probability in zip(sources, episodes, probabilities, strict=True):
        table = _episode_image_statistics(source, key)
        for name, parts in per_part.items():
            parts.append(table[name][chosen])
        lengths = (source.ends - source.starts)[chosen]
        weights.append(probability * lengths / lengths.sum())
    weight = np.concatenate(weights).reshape(-1, 1, 1, 1)
    stacked = {name: np.concatenate(parts) for name, parts in per_part.items()}
    mean = (weight * stacked["mean"]).sum(axis=0)
    # Var[x] = E[Var[x | episode]] + Var[E[x | episode]]
    variance = (weight * (stacked["std"] ** 2 + (stacked["mean"] - mean) ** 2)).sum(axis=0)
    return {
        "min": stacked["min"].min(axis=0),
        "max": stacked["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": np.array([sum(int((s.ends - s.starts)[e].sum()) for s, e in zip(sources, episodes, strict=True))]),
    }


def _episode_image_statistics(source: DatasetSource, key: str) -> dict[str, NDArray[np.float64]]:
    """Statistics (episodes, 3, 1, 1) of each episode."""
    names = [f"stats/{key}/{name}" for name in ("min", "max", "mean", "std")]
    files = sorted((source.root / "meta" / "episodes").glob("*/*.parquet"))
    if not all(set(names) <= set(pq.read_schema(path).names) for path in files):
        raise UserError(
            f"{source.root}: no statistics of {key} in meta/episodes; convert the dataset again, or set the phase's "
            "`image_statistics: imagenet`."
        )
    tables = [pq.read_table(path, columns=[*names, "episode_index"]) for path in files]
    order = np.argsort(np.concatenate([table.column("episode_index").to_numpy() for table in tables]))
    out = {}
    for name in names:
        rows = [row for table in tables for row in table.column(name).to_pylist()]
        out[name.rsplit("/", 1)[1]] = np.asarray(rows, dtype=np.float64).reshape(len(rows), 3, 1, 1)[order]
    return out
