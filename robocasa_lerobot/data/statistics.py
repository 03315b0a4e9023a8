"""Statistics of a mixture's frames in LeRobot's format, each frame weighted by how often the mixture draws its dataset.

The data are read block by block, so that their number is not limited by memory.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.data.quantiles import QuantileSearch
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jobs.locks import locked
from robocasa_lerobot.progress import Bar

Statistics = dict[str, dict[str, NDArray[Any]]]
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
BOOKKEEPING = ("timestamp", "frame_index", "episode_index", "index", "task_index")
FORMAT = 1  # counted up when stored statistics would come out differently
_BLOCK = 65_536  # frames
_IMAGE_STATISTICS = ("min", "max", "mean", "std")


@dataclass(frozen=True)
class Part:
    """Episodes of a dataset and how often all their frames together are drawn; `use` makes the dataset ready."""

    source: DatasetSource
    episodes: NDArray[np.int64]
    probability: float
    use: Callable[[DatasetSource], DatasetSource] = lambda source: source

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int((self.source.ends - self.source.starts)[self.episodes].sum())

    def blocks(self) -> Iterator[dict[str, NDArray[Any]]]:
        """The columns over the part's frames, in blocks of consecutive ones."""
        columns = self.use(self.source).columns
        starts, ends = self.source.starts[self.episodes], self.source.ends[self.episodes]
        breaks = np.flatnonzero(starts[1:] != ends[:-1])  # episodes that follow one another are read together
        for first, last in zip(starts[[0, *(breaks + 1)]], ends[[*breaks, -1]], strict=True):
            for at in range(int(first), int(last), _BLOCK):
                yield {key: column[at : min(at + _BLOCK, int(last))] for key, column in columns.items()}


def pooled_statistics(parts: Sequence[Part], images: bool = True, unseen: Collection[str] = ()) -> Statistics:
    """Statistics over the episodes of all parts.

    Numbers: mean and standard deviation (population) of all frames by weight, exact extremes, and quantiles of
    all frames by weight (inverse of the distribution function), each of shape (dim,). Images, unless left out: mean,
    standard deviation and extremes pooled from the statistics that the dataset holds for each episode, shape
    (3, 1, 1), values in [0, 1]; they have no quantiles, because those of a union do not follow from those of its parts.
    Of a camera that not all datasets have, or that is among `unseen`, there are none: nothing is seen of it.

    Raises:
        UserError: a dataset has no statistics of its images, or a number that is not finite.
    """
    out: Statistics = {}
    columns: dict[str, _Column] = {}
    for key, feature in parts[0].source.features.items():
        if contract.is_picture(feature):
            if images and key not in unseen and all(key in part.source.features for part in parts):
                out[key] = _image_statistics(key, parts)
        elif has_statistics(key, feature):
            columns[key] = _Column(int(np.prod(feature["shape"])), str(feature["dtype"]))
            out[key] = {}  # in the order of the features
    for number in range(max((c.quantiles.passes for c in columns.values()), default=0)):
        progress = Bar(
            parts,
            desc=f"statistics, pass {number + 1}",
            unit="dataset",
            mininterval=0.2 if sys.stderr.isatty() else 10.0,  # seconds; a log file needs few lines
            disable=len(parts) < 10,
        )
        for part in progress:
            _pass(part, {key: c for key, c in columns.items() if number < c.quantiles.passes}, moments=number == 0)
        for column in columns.values():
            if number < column.quantiles.passes:
                column.quantiles.narrow()
    count = np.array([sum(part.frames for part in parts)])
    return out | {key: column.statistics(count) for key, column in columns.items()}


def has_statistics(key: str, feature: Mapping[str, Any]) -> bool:
    """Whether a feature is a number that policies may see."""
    return key not in BOOKKEEPING and str(feature["dtype"]).startswith(("float", "int", "uint", "bool"))


def cached_statistics(
    parts: Sequence[Part], folder: Path, images: bool = True, unseen: Collection[str] = ()
) -> Statistics:
    """`pooled_statistics`, kept in `folder`: of several processes one computes, the others read."""
    left_out = [sorted(unseen)] if unseen else []
    digest = hashlib.sha256(json.dumps([FORMAT, images, *left_out]).encode())
    for part in parts:
        digest.update(part.source.fingerprint.encode() + part.episodes.tobytes())
        digest.update(np.float64(part.probability).tobytes())
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"statistics_{digest.hexdigest()[:16]}.json"
    with locked(path.with_suffix(".lock"), wait=True):
        if not path.is_file():
            stats = pooled_statistics(parts, images, unseen)
            text = {key: {name: v.tolist() for name, v in values.items()} for key, values in stats.items()}
            write_text(path, json.dumps(text))
    stored = json.loads(path.read_text())
    return {key: {name: np.array(v) for name, v in values.items()} for key, values in stored.items()}


class _Column:
    """Running statistics of one numeric feature of `size` components."""

    def __init__(self, size: int, dtype: str) -> None:
        self.size = size
        self.dtype = np.dtype(np.float32 if dtype.startswith("float") else np.float64)  # integers need all their bits
        self.quantiles = QuantileSearch(size, list(QUANTILES.values()), self.dtype)
        self.min, self.max = np.full(size, np.inf), np.full(size, -np.inf)
        self.moments: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = []  # weight, mean, variance

    def statistics(self, count: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        weight = np.array([w for w, _, _ in self.moments])
        means = np.stack([mean for _, mean, _ in self.moments])
        variances = np.stack([variance for _, _, variance in self.moments])
        weight = weight / weight.sum()
        mean = weight @ means
        # Var[x] = E[Var[x | part]] + Var[E[x | part]]
        std = np.sqrt(weight @ (variances + (means - mean) ** 2))
        values = dict(zip(QUANTILES, self.quantiles.result().astype(np.float64), strict=True))
        return {"min": self.min, "max": self.max, "mean": mean, "std": std, "count": count, **values}


def _pass(part: Part, columns: dict[str, _Column], moments: bool) -> None:
    each = part.probability / part.frames
    seen = dict.fromkeys(columns, 0)
    mean = {key: np.zeros(column.size) for key, column in columns.items()}
    squares = {key: np.zeros(column.size) for key, column in columns.items()}
    for block in part.blocks():
        for key, column in columns.items():
            values = block[key].reshape(len(block[key]), -1).astype(column.dtype)
            if moments:
                if not np.isfinite(values).all():
                    raise UserError(
                        f"{part.source.root}: {key} has values that are not finite; run `robocasa-lerobot verify`."
                    )
                column.min = np.minimum(column.min, values.min(axis=0))
                column.max = np.maximum(column.max, values.max(axis=0))
                # Means and sums of squared deviations of two sets joined (Chan, Golub and LeVeque 1979).
                wide = values.astype(np.float64)
                own = wide.mean(axis=0)
                apart, count, total = own - mean[key], len(wide), seen[key] + len(wide)
                squares[key] += ((wide - own) ** 2).sum(axis=0) + apart**2 * (seen[key] * count / total)
                mean[key] += apart * (count / total)
                seen[key] = total
            column.quantiles.add(values, each)
    if moments:
        for key, column in columns.items():
            column.moments.append((part.probability, mean[key], squares[key] / seen[key]))


def _image_statistics(key: str, parts: Sequence[Part]) -> dict[str, NDArray[Any]]:
    pooled: dict[str, list[NDArray[Any]]] = {name: [] for name in _IMAGE_STATISTICS}
    weights: list[NDArray[Any]] = []
    for part in parts:
        table = _episode_image_statistics(part.source, key)
        for name, of_parts in pooled.items():
            of_parts.append(table[name][part.episodes])
        lengths = (part.source.ends - part.source.starts)[part.episodes]
        weights.append(part.probability * lengths / lengths.sum())
    weight = np.concatenate(weights).reshape(-1, 1, 1, 1)
    stacked = {name: np.concatenate(of_parts) for name, of_parts in pooled.items()}
    mean = (weight * stacked["mean"]).sum(axis=0)
    # Var[x] = E[Var[x | episode]] + Var[E[x | episode]]
    variance = (weight * (stacked["std"] ** 2 + (stacked["mean"] - mean) ** 2)).sum(axis=0)
    return {
        "min": stacked["min"].min(axis=0),
        "max": stacked["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": np.array([sum(part.frames for part in parts)]),
    }


def _episode_image_statistics(source: DatasetSource, key: str) -> dict[str, NDArray[np.float64]]:
    """Statistics (episodes, 3, 1, 1) of each episode."""
    names = [f"stats/{key}/{name}" for name in _IMAGE_STATISTICS]
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
        values = np.concatenate([_flat(chunk) for table in tables for chunk in table.column(name).chunks])
        out[name.rsplit("/", 1)[1]] = values.astype(np.float64).reshape(len(order), 3, 1, 1)[order]
    return out


def _flat(array: Any) -> NDArray[Any]:
    """The numbers in a column of nested lists."""
    while hasattr(array.type, "value_type"):
        array = array.flatten()
    values: NDArray[Any] = array.to_numpy(zero_copy_only=False)
    return values
