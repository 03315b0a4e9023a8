"""Episodes that are not trained on, and the loss on them for each task."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from accelerate import Accelerator
from accelerate.utils import gather_object
from numpy.typing import NDArray

from robocasa_lerobot.data.mixture import MixtureDataset, open_mixture
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading.source import EPISODE_TABLE, DatasetSource
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl
from robocasa_lerobot.training.config.phase import HeldOutConfig

Forward = Callable[[dict[str, Any]], tuple[torch.Tensor, Any]]


def without_held_out(
    dataset: MixtureDataset, config: HeldOutConfig, loader: LoaderConfig, seed: int
) -> tuple[MixtureDataset, MixtureDataset | None]:
    """The mixture without its held-out episodes, and one of those alone; None where tasks have too few episodes.

    Too few are fewer than those of which the share is one: of two demonstrations it would be half. A dataset that is
    a member twice has the same ones held out.

    Raises:
        UserError: a member has but episodes that are held out, so that nothing is left of it to train on.
    """
    used_of: dict[str, list[NDArray[np.int64]]] = {}
    for member in dataset.config.members:
        used_of.setdefault(member.root, []).append(dataset.sources[Path(member.root)].select(member))
    held_of = {
        root: _held_out(dataset.sources[Path(root)], np.unique(np.concatenate(parts)), config.share, seed)
        for root, parts in used_of.items()
    }
    kept, apart = [], []
    for member, probability in zip(dataset.config.members, dataset.probabilities, strict=True):
        source = dataset.sources[Path(member.root)]
        used = source.select(member)
        held = np.intersect1d(used, held_of[member.root])
        left = np.setdiff1d(used, held)
        if not len(left):
            raise UserError(f"{member.root}: `held_out` leaves no episode to train on; give more data or less share.")
        plain = MemberConfig(member.root, weight=float(probability), frames=member.frames)
        kept.append(dataclasses.replace(plain, episodes=left.tolist()))
        if len(held):
            apart.append(dataclasses.replace(plain, episodes=held.tolist(), frames=None))
    if not apart:
        return dataset, None
    parts = (MixtureConfig(members=kept, draw=dataset.config.draw), MixtureConfig(members=apart))
    return open_mixture(parts[0], loader, dataset.sources), open_mixture(parts[1], loader, dataset.sources)


@dataclasses.dataclass
class HeldOut:
    """The held-out frames of each task: (member, frame) pairs of the mixture `dataset`, the same at every measurement.

    `part` frames go through the policy at once.
    """

    config: HeldOutConfig
    dataset: MixtureDataset
    frames: dict[str, NDArray[np.int64]]
    part: int

    def due(self, step: int, last: int) -> bool:
        """Whether to measure after this step."""
        return step % self.config.every == 0 or step == last

    @torch.no_grad()
    def measure(self, forward: Forward, seed: int, accelerator: Accelerator) -> dict[str, float]:
        """Mean loss of each task's frames; processes share the tasks. `forward` takes a batch as the dataset has it.

        Noise is the same at every measurement, so that losses differ by the policy alone.
        """
        mine = {}
        for number, (task, chosen) in enumerate(self.frames.items()):
            if number % accelerator.num_processes != accelerator.process_index:
                continue
            torch.manual_seed(seed)
            random.seed(seed)  # what GR00T's preprocessor draws from
            total = 0.0
            for part in np.array_split(chosen, max(1, round(len(chosen) / self.part))):
                loss, _ = forward(self.dataset.batch(part[:, 0], part[:, 1]))
                total += float(loss) * len(part)
            mine[task] = total / len(chosen)
        if accelerator.num_processes == 1:
            return mine
        parts: list[dict[str, float]] = gather_object([mine])
        return {task: next(part[task] for part in parts if task in part) for task in self.frames}


def held_out_frames(dataset: MixtureDataset, samples: int, seed: int) -> dict[str, NDArray[np.int64]]:
    """Up to `samples` frames of each task, drawn without repeats: arrays (n, 2) of member and frame."""
    of_task: dict[str, list[NDArray[np.int64]]] = {}
    for number, member in enumerate(dataset.config.members):
        source = dataset.sources[Path(member.root)]
        names = task_names(source)
        for episode in source.select(member):
            frames = np.arange(source.starts[episode], source.ends[episode])
            pairs = np.stack([np.full(len(frames), number), frames], axis=1)
            of_task.setdefault(names[episode], []).append(pairs)
    out = {}
    for number, (task, parts) in enumerate(sorted(of_task.items())):
        pairs, generator = np.concatenate(parts), np.random.default_rng((seed, number))
        out[task] = pairs[np.sort(generator.permutation(len(pairs))[:samples])]
    return out


def task_names(source: DatasetSource) -> list[str]:
    """The task of each episode; the folder's name stands for all where the dataset does not say."""
    table = source.root / EPISODE_TABLE
    if not table.is_file():
        return [source.root.as_posix()] * len(source.starts)
    by_episode = {int(row["episode_index"]): str(row["task_name"]) for row in read_jsonl(table)}
    return [by_episode.get(index, source.root.as_posix()) for index in range(len(source.starts))]


def _held_out(source: DatasetSource, used: NDArray[np.int64], share: float, seed: int) -> NDArray[np.int64]:
    """Episodes that are held out: of each task its share of the whole dataset, so that phases agree, as far as used.

    Where none of these is among the `used` ones it is one of them, and one of them is always left to train on. Of a
    task with fewer used episodes than those of which the share is one, none is held out.
    """
    names = np.array(task_names(source))
    chosen: list[NDArray[np.int64]] = [np.zeros(0, dtype=np.int64)]
    for name in np.unique(names[used]):
        episodes = np.flatnonzero(names == name)
        generator = np.random.default_rng((seed, len(episodes), int(episodes[0])))
        order = generator.permutation(episodes)
        among = order[np.isin(order, used)]
        if share * len(among) < 1 - 1e-9:  # for shares such as 1/49, which floats cannot hold
            continue
        count = min(max(1, round(share * len(episodes))), len(episodes) - 1)
        held = np.intersect1d(order[:count], used)
        held = held if len(held) else among[:1]
        chosen.append(held if len(held) < len(among) else among[:-1])
    return np.sort(np.concatenate(chosen)).astype(np.int64)
