"""Recorded episodes for the `replay` policy: scene seeds and actions of an HDF5 file or a LeRobotDataset."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError


@dataclass(frozen=True)
class StoredEpisode:
    """An episode: task, split and seed of its scene, and its actions (T, 12) float32 in stored order."""

    task: str
    split: str
    seed: int
    actions: NDArray[np.float32]


def read_episodes(path: Path) -> list[StoredEpisode]:
    """All episodes of a file of demonstrations or a dataset whose scenes this project can make again.

    Raises:
        UserError: neither, or an episode without the seed of its scene (recorded by other software), or in a scene
            that the seed alone does not make again.
    """
    return _of_dataset(path) if path.is_dir() else _of_file(path)


def one_per_scene(episodes: Iterable[StoredEpisode]) -> dict[tuple[str, str, int], StoredEpisode]:
    """The first episode of each scene, by task, split and seed: replayed again, a scene would be no further trial."""
    found: dict[tuple[str, str, int], StoredEpisode] = {}
    for episode in episodes:
        found.setdefault((episode.task, episode.split, episode.seed), episode)
    return found


def _of_file(path: Path) -> list[StoredEpisode]:
    from robocasa_lerobot.convert.reading.demo_file import DemoFile

    with DemoFile(path) as file:
        demos = [(name, file.demo(name)) for name in file.demo_names]
        return [
            _episode(f"{path}, {name}", file.env_name, demo.ep_meta, contract.hdf5_to_stored(demo.actions))
            for name, demo in demos
        ]


def _of_dataset(root: Path) -> list[StoredEpisode]:
    from robocasa_lerobot.convert.lerobot_v3 import ExportedDataset  # imports LeRobot

    dataset = ExportedDataset(root)
    out = []
    for episode in dataset.episodes:
        file = dataset.extras(episode) / "ep_meta.json"
        meta = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
        actions = dataset.columns(episode)[contract.ACTION_KEY]
        out.append(_episode(f"{root}, episode {episode.index}", episode.task_name, meta, actions))
    return out


def _episode(where: str, task: str, meta: dict[str, Any], actions: NDArray[Any]) -> StoredEpisode:
    if type(meta.get("seed")) is not int or "split" not in meta:
        raise UserError(
            f"{where}: its ep_meta has no scene seed and split, so that its kitchen cannot be made again; "
            "`robocasa-lerobot demos` records files that can be replayed."
        )
    if "layouts" in meta or "styles" in meta:
        raise UserError(
            f"{where}: recorded with --layouts or --styles, so that its seed is another kitchen here. "
            "`robocasa-lerobot replay` makes its own kitchen again."
        )
    if meta.get("initial_noise"):
        raise UserError(
            f"{where}: its ep_meta has initial_noise (recorded with --start-within), so that its robot starts "
            "elsewhere here. `robocasa-lerobot replay` makes its own start again."
        )
    return StoredEpisode(task, str(meta["split"]), meta["seed"], np.asarray(actions, dtype=np.float32))
