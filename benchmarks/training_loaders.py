"""Loaders without a policy, LeRobot's and ours, and LeRobot's samples in the form that our loop takes them."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from lerobot.configs.default import DatasetConfig
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.sampler import EpisodeAwareSampler
from lerobot.utils.collate import lerobot_collate_fn

from robocasa_lerobot import contract
from robocasa_lerobot.data.mixture import MixtureDataset, StepBatches
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig

type Windows = Mapping[str, Sequence[float]]
WARM_UP = 2  # batches before the clock starts: decoders open, worker processes are there
LEROBOT, DECODING, CACHED = "lerobot", "decoding", "cached"


def lerobot_dataset(root: Path, windows: Windows | None) -> LeRobotDataset:
    """The dataset as `lerobot-train` opens it: LeRobot's decoder of choice, pictures as bytes."""
    backend = DatasetConfig(repo_id=root.name).video_backend
    return LeRobotDataset(
        root.name,
        root=root,
        delta_timestamps={key: list(times) for key, times in windows.items()} if windows else None,
        video_backend=backend,
        return_uint8=True,
    )


def lerobot_sampler(dataset: LeRobotDataset, drop_last_frames: int = 0, seed: int = 0) -> EpisodeAwareSampler:
    """The sampler as `lerobot-train` makes it."""
    episodes = dataset.meta.episodes
    return EpisodeAwareSampler(
        episodes["dataset_from_index"],
        episodes["dataset_to_index"],
        episode_indices_to_use=dataset.episodes,
        drop_n_last_frames=drop_last_frames,
        shuffle=True,
        seed=seed,
        absolute_to_relative_idx=dataset.absolute_to_relative_idx,
    )


def lerobot_collate(dataset: LeRobotDataset) -> Callable[..., Any]:
    """How `lerobot-train` puts samples together: by itself where a dataset tells stages, whose columns are lists."""
    collate: Callable[..., Any] = torch.utils.data.default_collate
    return lerobot_collate_fn if dataset.meta.has_language_columns else collate


class LeRobotBatches(torch.utils.data.Dataset[dict[str, Any]]):
    """Batch i of LeRobot's samples in LeRobot's order, for a loop that asks for batches by number."""

    def __init__(self, dataset: LeRobotDataset, batch_size: int, drop_last_frames: int = 0) -> None:
        self.dataset, self.batch_size = dataset, batch_size
        self._order = list(lerobot_sampler(dataset, drop_last_frames))

    def __getitem__(self, index: int) -> dict[str, Any]:
        first = index * self.batch_size
        chosen = (self._order[i % len(self._order)] for i in range(first, first + self.batch_size))
        batch: dict[str, Any] = lerobot_collate(self.dataset)([self.dataset[i] for i in chosen])
        return batch


def windows_for(n_obs_steps: int, chunk: int) -> dict[str, list[float]]:
    """Seconds of observations up to the present, and of the `chunk` actions from now on."""
    seen = [i / contract.VIDEO_FPS for i in range(1 - n_obs_steps, 1)]
    planned = [i / contract.VIDEO_FPS for i in range(chunk)]
    return {**dict.fromkeys((*contract.IMAGE_KEYS, contract.STATE_KEY), seen), contract.ACTION_KEY: planned}


def open_loader(kind: str, root: Path, windows: Windows, batch_size: int, workers: int, cache: Path) -> Iterator[Any]:
    """Endless batches: LeRobot's dataset, sampler and PyTorch's DataLoader, or our mixture, decoding or cached.

    Filling the cache is done here, before the first batch.
    """
    processes: dict[str, Any] = {"num_workers": workers}
    if workers:
        processes |= {"prefetch_factor": 2, "multiprocessing_context": "spawn"}
    if kind == LEROBOT:
        dataset = lerobot_dataset(root, windows)
        loader = torch.utils.data.DataLoader(
            dataset,
            batch_size=batch_size,
            sampler=lerobot_sampler(dataset),
            drop_last=True,
            collate_fn=lerobot_collate(dataset),
            **processes,
        )
        return itertools.chain.from_iterable(itertools.repeat(loader))
    mixture = MixtureDataset(MixtureConfig([MemberConfig(str(root))]))
    mixture.set_windows(windows)
    if kind == CACHED:
        mixture.cache_frames(cache)
    batches = StepBatches(mixture, mixture.sampler(seed=0), batch_size)
    return iter(torch.utils.data.DataLoader(batches, batch_size=None, sampler=range(1_000_000), **processes))


def samples_per_second(batches: Iterator[Any], batch_size: int, seconds: float) -> float:
    """Rate of a loader over at least `seconds`, and whole batches."""
    for _ in range(WARM_UP):
        next(batches)
    start, count = time.perf_counter(), 0
    while (taken := time.perf_counter() - start) < seconds or not count:
        next(batches)
        count += 1
    return count * batch_size / taken
