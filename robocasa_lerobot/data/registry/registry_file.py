"""Registry files: which datasets a user has or can make, as data.

A registry file is YAML; every path counts from `root`, which counts from the working directory:

    base: other.yaml            # a registry file, counted from this one, that this one is laid over; or several
    root: datasets
    scheme: robocasa365         # also look for the published datasets in `root`; leave out otherwise
    only: demonstrated          # of the benchmark's task sets, the tasks that a demonstrator can solve
    task_sets: {drawers: [OpenDrawer, CloseDrawer]}
    episodes: {human: 20}       # demonstrations of each task that recipes record
    datasets:
      - {path: mine/drawers, tasks: [OpenDrawer, CloseDrawer], split: pretrain, source: demonstrator,
         get: "robocasa-lerobot demos ..."}
      - {path: "ours/{task}", task_set: atomic_seen, make: {episodes: human, seed: 1000000}}  # a folder for each task
"""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from robocasa_lerobot.data.mixture_config import ROBOCASA365
from robocasa_lerobot.data.registry.recipes import RecipeConfig
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import Data, check_keys, decode, load_yaml

DEMONSTRATED = "demonstrated"  # value of `only`
TASK = "{task}"  # in a `path`
_BASE = "base"


@dataclass
class RegisteredDataset:
    """A dataset of a registry file.

    Attributes:
        path: folder of a LeRobotDataset v3.0, counted from the registry's `root`. With `{task}` in it, each task has
            a folder of its own.
        tasks: the tasks in it; None, without a `task_set`, reads them from its `meta/robocasa/episodes.jsonl`.
        task_set: a set of tasks, instead.
        split: `pretrain` or `target`, or a name of the user's own.
        source: where it comes from, such as `human`, `demonstrator` or `real`.
        views: as the published folders' last name; selections ask for it.
        get: what to do if it is not there.
        make: how our demonstrators make it, for `robocasa-lerobot data --make`.
    """

    path: str
    tasks: list[str] | None = None
    task_set: str | None = None
    split: str = "pretrain"
    source: str = "human"
    views: str = "lerobot"
    get: str | None = None
    make: RecipeConfig | None = None

    def __post_init__(self) -> None:
        if TASK in self.path and self.tasks is None and self.task_set is None:
            raise UserError(f"dataset {self.path!r}: a path with {TASK} needs `tasks` or a `task_set`.")
        if self.make is not None and TASK not in self.path:
            raise UserError(
                f"dataset {self.path!r}: recorded data has a folder for each task; put {TASK} into the path."
            )


@dataclass
class RegistryConfig:
    """A registry file; see the top of this module."""

    root: str = "."
    scheme: str | None = None
    only: str | None = None
    episodes: dict[str, int] = field(default_factory=dict)
    task_sets: dict[str, list[str]] = field(default_factory=dict)
    datasets: list[RegisteredDataset] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.scheme not in (None, ROBOCASA365):
            raise UnknownNameError("scheme of a registry:", str(self.scheme), [ROBOCASA365])
        if self.only not in (None, DEMONSTRATED):
            raise UnknownNameError("`only` of a registry:", str(self.only), [DEMONSTRATED])
        for kind, number in self.episodes.items():
            if number < 1:
                raise UserError(f"episodes of {kind!r}: found {number}, expected at least 1.")
        for dataset in self.datasets:
            if dataset.make is not None and dataset.make.episodes not in self.episodes:
                where = f"(`episodes` of the recipe of {dataset.path})"
                raise UnknownNameError("kind of dataset", dataset.make.episodes, self.episodes, where)


def load_registry(path: Path) -> RegistryConfig:
    """What a registry file says, with those it is laid over.

    Raises:
        UserError: no such file, files that are each other's base, an unknown key, or a value that does not fit.
    """
    return copy.deepcopy(_decoded(pickle.dumps(_load(path, ())), str(path)))


@lru_cache(maxsize=16)
def _decoded(content: bytes, where: str) -> RegistryConfig:
    """A plan of the study asks for the same registry 161 times, and decoding it takes 25 ms."""
    return decode(RegistryConfig, pickle.loads(content), where)


def _load(path: Path, above: tuple[Path, ...]) -> Data:
    if path.resolve() in above:
        raise UserError(f"{path} is its own base, through {', '.join(p.name for p in above)}.")
    data = load_yaml(path)
    base = data.pop(_BASE, None)
    check_keys(RegistryConfig, data, str(path))
    out: Data = {}
    layers = [_load(path.parent / str(name), (*above, path.resolve())) for name in _names(base)]
    for layer in (*layers, data):
        for key, value in layer.items():  # sets of tasks and numbers of demonstrations one by one, all else is replaced
            both = isinstance(value, dict) and isinstance(out.get(key), dict)
            out[key] = {**out[key], **value} if both else value
    return out


def _names(base: Any) -> list[Any]:
    return base if isinstance(base, list) else [] if base is None else [base]
