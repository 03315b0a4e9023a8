"""Where datasets are: RoboCasa365's published folders, a user's own registry file, and what is missing of them.

A registry file is YAML; every path counts from `root`, which counts from the working directory:

    root: datasets
    scheme: robocasa365         # also look for the published datasets in `root`; leave out otherwise
    task_sets: {drawers: [OpenDrawer, CloseDrawer]}
    datasets:
      - {path: mine/drawers, tasks: [OpenDrawer, CloseDrawer], split: pretrain, source: demonstrator,
         get: "robocasa-lerobot demos ..."}
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robocasa_lerobot.data.config import ROBOCASA365, MemberConfig, MixtureConfig, SelectionConfig
from robocasa_lerobot.data.published import (
    PUBLISHED,
    DatasetEntry,
    PublishedDatasets,
    dataset_version,
    published_task_sets,
    published_tasks,
)
from robocasa_lerobot.data.source import EPISODE_TABLE
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import decode, load_yaml

_SHOWN = 20  # missing datasets that an error lists


class MissingDatasetsError(UserError):
    """Datasets that a mixture asks for and that are not there; the message says how to get or make them."""

    def __init__(self, entries: Sequence[DatasetEntry]) -> None:
        self.entries = tuple(entries)
        by_remedy: dict[str, list[DatasetEntry]] = {}
        for entry in self.entries:
            by_remedy.setdefault(str(entry.missing), []).append(entry)
        lines = [f"{len(self.entries)} dataset(s) of the mixture are missing:"]
        for remedy, group in list(by_remedy.items())[:_SHOWN]:
            shown = ", ".join(f"{e.task} ({e.split}, {e.source})" for e in group[:_SHOWN])
            lines.append(f"  {shown}{f' and {len(group) - _SHOWN} more' if len(group) > _SHOWN else ''}: {remedy}")
        if len(by_remedy) > _SHOWN:
            lines.append(f"  ... and {sum(map(len, list(by_remedy.values())[_SHOWN:]))} more")
        super().__init__("\n".join(lines))


@dataclass
class RegisteredDataset:
    """A dataset of a registry file.

    Attributes:
        path: folder of a LeRobotDataset v3.0, counted from the registry's `root`.
        tasks: the tasks in it; None reads them from its `meta/robocasa/episodes.jsonl`.
        split: `pretrain` or `target`, or a name of the user's own.
        source: where it comes from, such as `human`, `demonstrator` or `real`.
        views: as the published folders' last name; selections ask for it.
        get: what to do if it is not there.
    """

    path: str
    tasks: list[str] | None = None
    split: str = "pretrain"
    source: str = "human"
    views: str = "lerobot"
    get: str | None = None


@dataclass
class RegistryConfig:
    """A registry file; see the top of this module."""

    root: str = "."
    scheme: str | None = None
    task_sets: dict[str, list[str]] = field(default_factory=dict)
    datasets: list[RegisteredDataset] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.scheme not in (None, ROBOCASA365):
            raise UnknownNameError("scheme of a registry:", str(self.scheme), [ROBOCASA365])


class Registry:
    """The datasets of a registry file, and the published ones if it says so."""

    def __init__(self, config: RegistryConfig) -> None:
        self.config = config
        self._read: dict[str, tuple[str, ...] | None] = {}  # tasks in datasets of which the registry does not say
        self.published = PublishedDatasets(Path(config.root)) if config.scheme == ROBOCASA365 else None

    @functools.cached_property
    def task_sets(self) -> dict[str, tuple[str, ...]]:
        """The benchmark's task sets and the file's own, which win."""
        return {**published_task_sets(), **{name: tuple(tasks) for name, tasks in self.config.task_sets.items()}}

    @functools.cached_property
    def tasks(self) -> frozenset[str]:
        """Names of all tasks that may be asked for."""
        own = {task for dataset in self.config.datasets for task in self._tasks_of(dataset) or ()}
        return frozenset(published_tasks()) | own | {task for tasks in self.config.task_sets.values() for task in tasks}

    @functools.cached_property
    def splits_and_sources(self) -> tuple[tuple[str, str], ...]:
        """The combinations that there are."""
        published = tuple(PUBLISHED) if self.published else ()
        return (*published, *((dataset.split, dataset.source) for dataset in self.config.datasets))

    def find(self, tasks: Sequence[str], split: str | None, source: str | None, views: str) -> list[DatasetEntry]:
        """What there should be of the tasks, in the order of the tasks."""
        found = self.published.find(tasks, split, source, views) if self.published else []
        for dataset in self.config.datasets:
            if split in (None, dataset.split) and source in (None, dataset.source) and views == dataset.views:
                found += self._entries(dataset, tasks)
        place = {task: number for number, task in enumerate(tasks)}
        return sorted(found, key=lambda entry: place[entry.task])

    def _entries(self, dataset: RegisteredDataset, tasks: Sequence[str]) -> Iterable[DatasetEntry]:
        root = Path(self.config.root) / dataset.path
        version, listed = dataset_version(root), self._tasks_of(dataset)
        missing = None
        if version != "v3.0":
            what = f"LeRobotDataset {version} there, v3.0 is needed" if version else "nothing there"
            missing = f"{root}: {what}; {dataset.get or 'correct the `path` in the registry, or convert it'}"
        for task in tasks if listed is None else [task for task in tasks if task in listed]:
            filtered = listed is None or len(listed) > 1
            yield DatasetEntry(task, dataset.split, dataset.source, root, missing, filtered)

    def _tasks_of(self, dataset: RegisteredDataset) -> tuple[str, ...] | None:
        """The dataset's tasks; None if the registry does not say and the dataset cannot."""
        if dataset.tasks is not None:
            return tuple(dataset.tasks)
        if dataset.path not in self._read:
            self._read[dataset.path] = _tasks_in(Path(self.config.root) / dataset.path / EPISODE_TABLE)
        return self._read[dataset.path]


def open_registry(name: str) -> Registry:
    """The registry of a selection: `robocasa365`, or that of a file.

    Raises:
        UserError: no such file, or an unknown key in it.
    """
    if name == ROBOCASA365:
        return Registry(RegistryConfig(root="datasets", scheme=ROBOCASA365))
    path = Path(name)
    if not path.is_file() and path.suffix not in (".yaml", ".yml"):
        raise UnknownNameError("registry", name, [ROBOCASA365], "A registry is that name, or a YAML file.")
    data = load_yaml(path)
    _check_keys(RegistryConfig, data, path)
    for item in data.get("datasets") or []:
        _check_keys(RegisteredDataset, item, path)
    return Registry(decode(RegistryConfig, data, str(path)))


def select_datasets(selection: SelectionConfig) -> list[DatasetEntry]:
    """The datasets that a selection asks for, there or not.

    Raises:
        UserError: an unknown task, set, split or source, a named task without data, or nothing at all.
    """
    registry = open_registry(selection.registry)
    named = tuple(selection.tasks or ())
    tasks = list(named)
    for task in tasks:
        if task not in registry.tasks:
            raise UnknownNameError("task", task, registry.tasks, f"(in the registry {selection.registry})")
    if selection.task_set is not None:
        if selection.task_set not in registry.task_sets:
            raise UnknownNameError("task set", selection.task_set, registry.task_sets)
        tasks += [task for task in registry.task_sets[selection.task_set] if task not in tasks]
    elif not tasks:
        tasks = sorted(registry.tasks)
    for number, (what, value) in enumerate((("split", selection.split), ("source", selection.source))):
        known = {pair[number] for pair in registry.splits_and_sources}
        if value is not None and value not in known:
            raise UnknownNameError(what, value, known, f"(in the registry {selection.registry})")
    entries = registry.find(tasks, selection.split, selection.source, selection.views)
    if selection.tasks_per_set is not None:
        of_set = [task for task in dict.fromkeys(entry.task for entry in entries) if task not in named]
        kept = {*named, *of_set[: selection.tasks_per_set]}
        entries = [entry for entry in entries if entry.task in kept]
    asked = f"split {selection.split or 'any'}, source {selection.source or 'any'}, views {selection.views}"
    without = [task for task in selection.tasks or () if task not in {entry.task for entry in entries}]
    if without:
        raise UserError(f"the registry {selection.registry} has no data of {', '.join(without)} with {asked}.")
    if not entries:
        raise UserError(f"the registry {selection.registry} has nothing with {asked}, task set {selection.task_set}.")
    return entries


def missing_datasets(config: MixtureConfig) -> list[DatasetEntry]:
    """The datasets of the mixture's selections and members that are not there, each with how to get it."""
    entries = [entry for selection in config.select for entry in select_datasets(selection) if entry.missing]
    for member in config.members:
        if not member.make_fake and dataset_version(Path(member.root)) != "v3.0":
            remedy = (
                f"record with `robocasa-lerobot demos` and convert with `robocasa-lerobot convert` to {member.root}"
            )
            tasks = "+".join(member.tasks or ["all tasks"])
            entries.append(DatasetEntry(tasks, "-", "member", Path(member.root), remedy))
    return entries


def resolve_mixture(config: MixtureConfig) -> MixtureConfig:
    """The same mixture with its selections written out as members.

    Raises:
        MissingDatasetsError: a selected dataset is not there; all of them are listed.
        UserError: as `select_datasets`.
    """
    if not config.select:
        return config
    chosen = [(selection, select_datasets(selection)) for selection in config.select]
    missing = [entry for _, entries in chosen for entry in entries if entry.missing]
    if missing:
        raise MissingDatasetsError(missing)
    members = list(config.members)
    for selection, entries in chosen:
        for entry in entries:
            tasks = [entry.task] if entry.task_filter else None
            members.append(
                MemberConfig(
                    str(entry.root),
                    tasks,
                    weight=selection.weight,
                    demos=selection.demos,
                    group=selection.group,
                    layouts=selection.layouts,
                    styles=selection.styles,
                )
            )
    return dataclasses.replace(config, members=members, select=[])


def _tasks_in(table: Path) -> tuple[str, ...] | None:
    """Names of the tasks in the table of episodes of a converted dataset, if it has one."""
    if not table.is_file():
        return None
    rows = (json.loads(line) for line in table.read_text(encoding="utf-8").splitlines() if line.strip())
    return tuple(sorted({str(row["task_name"]) for row in rows}))


def _check_keys(kind: type, data: object, path: Path) -> None:
    known = {f.name for f in dataclasses.fields(kind)}
    if not isinstance(data, dict):
        raise UserError(f"{path}: found {data!r} in `datasets`, expected mappings with {sorted(known)}.")
    for key in data:
        if key not in known:
            raise UnknownNameError("key", str(key), known, f"(in {path})")
