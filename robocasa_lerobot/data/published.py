"""RoboCasa365's published datasets: what there is of which task, and the folders it lies in."""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from robocasa_lerobot.data.registry_file import RegisteredDataset
from robocasa_lerobot.errors import UserError

VERSION_FOLDER = "v1.0"  # of RoboCasa365's datasets
CONVERTED = "_v3"  # after the name of a published (v2.1) dataset's folder: its conversion, beside it
TARGET_SETS = ("atomic_seen", "composite_seen", "composite_unseen")


@dataclass(frozen=True)
class DatasetEntry:
    """A dataset of one task, or the part of a dataset that is one task's; `missing` says how to get it, if it is.

    `root` is where it is or should be, relative to the working directory if the registry is; `task_filter` says
    that the dataset has other tasks too; `registered` is what a registry file says of it, None for published ones.
    """

    task: str
    split: str
    source: str
    root: Path
    missing: str | None = None
    task_filter: bool = False
    registered: RegisteredDataset | None = None


@dataclass(frozen=True)
class TaskFacts:
    """What the benchmark says of one of its 365 tasks, whether it can be run here or not.

    `kind` is `atomic` or `composite`. `activity` (one of 60) and its `family` (one of 6) are None for atomic tasks.
    `subtasks` is the number of skills in a row, `mobile` whether the base has to move. `horizon` is RoboCasa 1.0.1's,
    control steps at 20 Hz, None where none is published. `human_seconds` is the mean length of a human demonstration.
    """

    task: str
    kind: str
    family: str | None
    activity: str | None
    subtasks: int
    mobile: bool
    horizon: int | None
    human_seconds: float
    sets: frozenset[str]


@functools.cache
def task_facts() -> dict[str, TaskFacts]:
    """Facts of all of RoboCasa365's tasks by name: its published list of attributes, corrected by the paper's tables.

    The tables list the 50 target tasks. They call three of them stationary that the list calls mobile, and name two
    activities otherwise; all tasks of such an activity have the table's name here.
    """
    text = resources.files("robocasa_lerobot.data").joinpath("robocasa365.jsonl").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in text.splitlines()]
    return {row["task"]: TaskFacts(**{**row, "sets": frozenset(row["sets"])}) for row in rows}


@functools.cache
def published_tasks() -> dict[str, tuple[str, frozenset[str]]]:
    """Kind (`atomic`, `composite`) and sets of each of RoboCasa365's tasks, by name."""
    return {name: (facts.kind, facts.sets) for name, facts in task_facts().items()}


@functools.cache
def published_task_sets() -> dict[str, tuple[str, ...]]:
    """The benchmark's task sets by name, with `target50` (the three target sets) and `diversity17`.

    `diversity17` are the atomic target tasks with MimicGen data, those of the scene-diversity experiment.
    """
    sets: dict[str, list[str]] = {}
    for task, (_, names) in published_tasks().items():
        own = set(names)
        own |= {"target50"} if own & set(TARGET_SETS) else set()
        own |= {"diversity17"} if {"atomic_seen", "mimicgen60"} <= own else set()
        for name in own:
            sets.setdefault(name, []).append(task)
    return {name: tuple(tasks) for name, tasks in sorted(sets.items())}


# Which tasks have data, by split and source. The two reduced MimicGen sets are used in the published experiment on
# scene diversity, but no download of them is known: they are looked for by the same pattern of folders, with the
# source's own name in the place of `mg`, and recipes of our own make them.
PUBLISHED: dict[tuple[str, str], str] = {
    ("pretrain", "human"): "pretrain300",
    ("pretrain", "mg"): "mimicgen60",
    ("pretrain", "mg_5x5"): "diversity17",
    ("pretrain", "mg_5x1"): "diversity17",
    ("target", "human"): "target50",
}
# RoboCasa's own command, in an environment with RoboCasa 1.0 (not on PyPI), as its documentation gives it.
DOWNLOAD_PAGE = "https://robocasa.ai/docs/build/html/datasets/using_datasets.html"
DOWNLOADS: dict[tuple[str, str], str] = {
    ("pretrain", "human"): "python -m robocasa.scripts.download_datasets --split pretrain --source human",
    ("pretrain", "mg"): "python -m robocasa.scripts.download_datasets --split pretrain --source mimicgen",
    ("target", "human"): "python -m robocasa.scripts.download_datasets --split target --source human",
}
# Demonstrations of each task; OpenCabinet has half as many of MimicGen's.
DEMONSTRATIONS: dict[tuple[str, str], int] = {
    ("pretrain", "human"): 100,
    ("pretrain", "mg"): 10_000,
    ("target", "human"): 500,
}
PUBLISHED_VIEWS = "lerobot"  # last name of the folders that are downloads


class PublishedDatasets:
    """RoboCasa365's datasets under a folder, in its scheme.

    `[v1.0/]<split>/<kind>/<Task>/<date>/lerobot` for human demonstrations, `.../<date>/mg/demo/<time>/lerobot` for
    those of MimicGen. They are published as LeRobotDataset v2.1; a conversion to v3.0 is looked for in their place
    and, with `_v3` after the name, beside them. Of several dates the newest counts.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._base = root / VERSION_FOLDER if (root / VERSION_FOLDER).is_dir() else root

    def find(self, tasks: Sequence[str], split: str | None, source: str | None, views: str) -> list[DatasetEntry]:
        """What is published of the tasks, in the order of the tasks, there or not."""
        wanted = [key for key in PUBLISHED if split in (None, key[0]) and source in (None, key[1])]
        found = []
        for task in tasks:
            for key in wanted:
                if task in published_task_sets()[PUBLISHED[key]]:
                    found.append(self._entry(task, *key, views))
        return found

    def _entry(self, task: str, split: str, source: str, views: str) -> DatasetEntry:
        parent = self._base / split / published_tasks()[task][0] / task
        inner = "*" if source == "human" else f"*/{source}/demo/*"
        dated = sorted(path for path in parent.glob(inner) if path.is_dir())
        for folder in reversed(dated):
            for name in (views, views + CONVERTED):
                if dataset_version(folder / name) == "v3.0":
                    return DatasetEntry(task, split, source, folder / name)
            version = dataset_version(folder / views)
            if version is not None:
                old, new = folder / views, folder / (views + CONVERTED)
                all_ = f"`robocasa-lerobot data --convert {self.root}`"
                remedy = (
                    f"{version} there, v3.0 is needed: `robocasa-lerobot convert {old} --out {new}`, or all: {all_}"
                )
                return DatasetEntry(task, split, source, new, remedy)
        inside = inner.replace("*", "<date>", 1).replace("*", "<time>")
        return DatasetEntry(task, split, source, parent, _remedy(split, source, views, parent.parent, inside))


def _remedy(split: str, source: str, views: str, kind: Path, inside: str) -> str:
    """What to do about a dataset of which nothing is there; the same words for all tasks."""
    expected = kind / "<Task>" / inside / views
    command = DOWNLOADS.get((split, source))
    make = "robocasa-lerobot data EXPERIMENT_FILE --make"
    ours = f"our demonstrators make their own for the experiments in configs/experiments/small/: `{make}`"
    if command is None:
        return f"no download of {source} is known; {ours}. Data of your own are looked for at {expected}"
    if views != PUBLISHED_VIEWS:
        plain = expected.with_name(PUBLISHED_VIEWS + CONVERTED)
        return (
            f"no download of these views is known: `{command}` ({DOWNLOAD_PAGE}), `robocasa-lerobot data --convert "
            f"{kind.parent.parent}`, then draw each again with `robocasa-lerobot render {plain} --out {expected} "
            "--camera-set cotraining`"
        )
    return (
        f"`{command}` ({DOWNLOAD_PAGE}) in an environment with RoboCasa puts them at {expected}, below RoboCasa's "
        f"`datasets` folder or DATASET_BASE_PATH; then `robocasa-lerobot data --convert {kind.parent.parent}`. "
        f"Without downloads, {ours}"
    )


def dataset_version(root: Path) -> str | None:
    """`codebase_version` of the LeRobot dataset at `root`; None if there is none."""
    path = root / "meta" / "info.json"
    if not path.is_file():
        return None
    try:
        return str(json.loads(path.read_text(encoding="utf-8")).get("codebase_version"))
    except ValueError as error:
        raise UserError(f"{path}: not valid JSON: {error}; get or convert the dataset again.") from error
