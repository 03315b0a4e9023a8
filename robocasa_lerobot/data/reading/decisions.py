"""Which frames of a dataset a person decided while a policy drove, and which the policy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.data.reading.column_file import column_types, read_columns
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.sampler import FramePool
from robocasa_lerobot.errors import UserError


class NoFramesError(UserError):
    """Episodes of which no frame was decided by those who were asked for."""


INTERVENTIONS = "interventions"  # the other one of `contract.FRAME_KINDS` is the policy's own steps


def frames_of(source: DatasetSource, kind: str) -> NDArray[np.bool_]:
    """Which frames (frames,) of a dataset are of a kind of `contract.FRAME_KINDS`.

    Raises:
        UserError: the dataset does not say who decided.
    """
    key = contract.decision_key("intervention")
    feature = source.decisions.get(key)
    if feature is None:
        raise UserError(
            f"{source.root}: `frames: {kind}` needs the feature {key}, which this dataset lacks. Record with "
            "`robocasa-lerobot teleop --policy=...` and convert, or leave `frames` out."
        )
    index = {"index": {"dtype": "int64", "shape": (1,)}}
    columns = read_columns(source.root, column_types({**index, key: feature}), source.total_frames)
    person: NDArray[np.bool_] = columns[key] > 0
    return person if kind == INTERVENTIONS else ~person


def ends_of_runs(source: DatasetSource, wanted: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each `wanted` frame (frames,) of a dataset the first and last ones around it without a gap; else itself.

    What is outside, somebody else has decided: actions that are learned from a kind of frame stay within.
    """
    goes_on = np.zeros(len(wanted), dtype=np.bool_)
    goes_on[:-1] = wanted[:-1] & wanted[1:]
    goes_on[source.ends - 1] = False
    ends, frames = np.flatnonzero(~goes_on), np.arange(len(wanted))
    starts = np.concatenate([[0], ends[:-1] + 1])
    run = np.searchsorted(ends, frames)
    return starts[run], ends[run]


def frame_pool(
    source: DatasetSource, episodes: NDArray[np.int64], wanted: NDArray[np.bool_] | None, drop_last_frames: int = 0
) -> FramePool:
    """The frames of some episodes, ascending, that may start a sample: all, or the `wanted` ones (frames,)."""
    starts, ends = source.starts[episodes], source.ends[episodes]
    # A shorter episode keeps its first frame (of the kind): no episode drops out of the training unnoticed.
    lengths = np.maximum(1, ends - starts - drop_last_frames)
    if wanted is None:
        return FramePool(starts, lengths)
    runs: list[tuple[int, int]] = []
    of_episodes: list[int] = []
    for start, end, length in zip(starts.tolist(), ends.tolist(), lengths.tolist(), strict=True):
        of_episode = wanted[start:end]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], of_episode[:length], [False]]).astype(np.int8)))
        new = [(start + begin, stop - begin) for begin, stop in edges.reshape(-1, 2).tolist()]
        if not new and of_episode.any():
            new = [(start + int(of_episode.argmax()), 1)]
        if new:
            runs += new
            of_episodes.append(sum(length for _, length in new))
    pool = np.array(runs, dtype=np.int64).reshape(-1, 2)
    return FramePool(pool[:, 0], pool[:, 1], np.array(of_episodes, dtype=np.int64))
