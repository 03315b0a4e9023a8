"""What data a registry has on this machine: tasks, scenes, demonstrations and hours, and the lengths of both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot.convert.inspect.dataset import inspect_dataset
from robocasa_lerobot.data.registry.published import PUBLISHED, DatasetEntry
from robocasa_lerobot.data.registry.registry import Registry
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

_EPISODES = "meta/robocasa/episodes.jsonl"
VIEWS = "lerobot"


@dataclass(frozen=True)
class Demonstration:
    """One demonstration: its task, its length in seconds, and its kitchen where the dataset says it."""

    task: str
    seconds: float
    kitchen: tuple[int, int] | None


@dataclass(frozen=True)
class Holding:
    """The datasets of one split, source and kind of views: the demonstrations there, and tasks that should have some.

    `folders` are the datasets that were read.
    """

    split: str
    source: str
    views: str
    tasks: tuple[str, ...]
    folders: tuple[Path, ...]
    demonstrations: tuple[Demonstration, ...]

    @property
    def name(self) -> str:
        """Split and source, with the views where these are not the usual ones."""
        return ", ".join((self.split, self.source, *(() if self.views == VIEWS else (self.views,))))

    @property
    def with_data(self) -> tuple[str, ...]:
        """The tasks that have demonstrations."""
        return tuple(dict.fromkeys(one.task for one in self.demonstrations))

    @property
    def scenes(self) -> int | None:
        """How many kitchens there are; None where no dataset says it."""
        kitchens = {one.kitchen for one in self.demonstrations if one.kitchen is not None}
        return len(kitchens) or None

    @property
    def hours(self) -> float:
        """Length of all demonstrations."""
        return sum(one.seconds for one in self.demonstrations) / 3600

    def as_json(self) -> dict[str, Any]:
        """Numbers alone."""
        lengths = sorted(one.seconds for one in self.demonstrations)
        return {
            "split": self.split,
            "source": self.source,
            "views": self.views,
            "tasks_with_data": len(self.with_data),
            "tasks": len(self.tasks),
            "scenes": self.scenes,
            "demonstrations": len(self.demonstrations),
            "hours": self.hours,
            "seconds": [lengths[0], lengths[len(lengths) // 2], lengths[-1]] if lengths else None,
            "datasets": [str(folder) for folder in self.folders],
        }


def take_inventory(registry: Registry) -> list[Holding]:
    """What there is of each split and source of a registry, in its order; nothing is loaded but tables of episodes.

    Raises:
        UserError: the metadata of a dataset cannot be read.
    """
    keys = [(split, source, VIEWS) for split, source in (PUBLISHED if registry.published else ())]
    keys += [(one.split, one.source, one.views) for one in registry.config.datasets]
    return [_holding(registry, *key) for key in dict.fromkeys(keys)]


def _holding(registry: Registry, split: str, source: str, views: str) -> Holding:
    entries = registry.find(sorted(registry.tasks), split, source, views)
    there = [entry for entry in entries if entry.missing is None]
    by_root: dict[Path, list[DatasetEntry]] = {}
    for entry in there:
        by_root.setdefault(entry.root, []).append(entry)
    found = [one for root, own in by_root.items() for one in _demonstrations(root, own)]
    tasks = tuple(dict.fromkeys(entry.task for entry in entries))
    return Holding(split, source, views, tasks, tuple(by_root), tuple(found))


def _demonstrations(root: Path, entries: Iterable[DatasetEntry]) -> list[Demonstration]:
    wanted = {entry.task: entry.task_filter for entry in entries}
    report = inspect_dataset(root)
    rate = float(report["fps"] or 0)
    if rate <= 0:
        raise UserError(f"{root}: its info.json has no `fps`; convert the dataset again.")
    path = root / _EPISODES
    if not path.is_file():
        if len(wanted) > 1:
            raise UserError(
                f"{root}: no {_EPISODES} says which episodes are of which task, and the registry does not either: name "
                "its task there (`tasks: [OpenDrawer]`), or convert the dataset with `robocasa-lerobot convert`."
            )
        task = next(iter(wanted))
        return [Demonstration(task, length / rate, None) for length in report["lengths"]]
    lengths = report["lengths"]
    out = []
    for row in read_jsonl(path):
        task, index = str(row.get("task_name")), int(row["episode_index"])
        if task in wanted or not any(wanted.values()):
            layout, style = row.get("layout_id"), row.get("style_id")
            kitchen = None if layout is None or style is None else (int(layout), int(style))
            out.append(Demonstration(task, lengths[index] / rate, kitchen))
    return out
