"""RoboCasa365's published datasets: what there is of which task, and the folders it lies in."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.benchmark.tasks import published_task_sets, published_tasks
from robocasa_lerobot.data.registry.registry_file import RegisteredDataset
from robocasa_lerobot.errors import UserError

VERSION_FOLDER = "v1.0"  # of RoboCasa365's datasets
CONVERTED = "_v3"  # after the name of a published (v2.1) dataset's folder: its conversion, beside it


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
# Demonstrations of each task, and where a task has another number.
DEMONSTRATIONS: dict[tuple[str, str], int] = {
    ("pretrain", "human"): 100,
    ("pretrain", "mg"): 10_000,
    ("target", "human"): 500,
}
FEWER = {("pretrain", "mg", "OpenCabinet"): 5_000}
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
        """The published datasets of the tasks, in the order of the tasks, there or not.

        Those that nobody can download are left out where nothing of them is there, unless their source is asked for.
        """
        wanted = [key for key in PUBLISHED if split in (None, key[0]) and source in (None, key[1])]
        found = []
        for task in tasks:
            for key in wanted:
                if task in published_task_sets()[PUBLISHED[key]]:
                    entry = self._entry(task, *key, views)
                    nothing = entry.root == self._folder(task, key[0])
                    if source is not None or key in DOWNLOADS or not nothing:
                        found.append(entry)
        return found

    def _folder(self, task: str, split: str) -> Path:
        return self._base / split / published_tasks()[task][0] / task

    def _entry(self, task: str, split: str, source: str, views: str) -> DatasetEntry:
        """The newest dataset that there is; with the task's folder as its root where there is none."""
        parent = self._folder(task, split)
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
