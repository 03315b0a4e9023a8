"""What each member of a mixture gives to it: a dataset, episodes of it, and which of their frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading.decisions import NoFramesError, ends_of_runs, frame_pool, frames_of
from robocasa_lerobot.data.reading.source import DatasetSource


@dataclass
class Member:
    """A dataset's part in a mixture.

    Attributes:
        source: the dataset.
        episodes: indices of those that are drawn from, ascending.
        frames: how many frames may start a sample.
        kind: of `contract.FRAME_KINDS`, which these are; None: all.
        wanted: of each frame of the dataset, whether it is of that kind.
        run: of each frame of the dataset, the first and the last one of its run of this kind.
    """

    source: DatasetSource
    episodes: NDArray[np.int64]
    frames: int
    kind: str | None = None
    wanted: NDArray[np.bool_] | None = None
    run: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None


def with_frames(config: MixtureConfig, opened: Mapping[Path, DatasetSource]) -> tuple[MixtureConfig, list[Member]]:
    """The mixture without members that have no frame of the kind that they ask for, and those that are left.

    Such a dataset is of a task that a policy needed no correction in.

    Raises:
        NoFramesError: none would be left.
    """
    kept: list[tuple[MemberConfig, Member]] = []
    without: list[NoFramesError] = []
    for member in config.members:
        source = opened[Path(member.root)]
        episodes, kind = source.select(member), member.frames
        wanted = None if kind is None else frames_of(source, kind)
        frames = frame_pool(source, episodes, wanted).size
        if not frames:
            lacking = f"no frame is left with frames={kind} in {len(episodes)} episodes."
            without.append(NoFramesError(f"{source.root}: {lacking}"))
            continue
        run = None if wanted is None else ends_of_runs(source, wanted)
        kept.append((member, Member(source, episodes, frames, kind, wanted, run)))
    if not kept:
        raise without[0]
    return dataclasses.replace(config, members=[member for member, _ in kept]), [one for _, one in kept]
