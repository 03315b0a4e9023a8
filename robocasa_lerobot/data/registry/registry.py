"""Where datasets are: RoboCasa365's published folders, a user's own registry file, and which of them are missing."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from pathlib import Path

from robocasa_lerobot.benchmark.tasks import published_task_sets, published_tasks
from robocasa_lerobot.data.mixture_config import ROBOCASA365, MemberConfig, MixtureConfig, SelectionConfig
from robocasa_lerobot.data.registry.published import PUBLISHED, DatasetEntry, PublishedDatasets, dataset_version
from robocasa_lerobot.data.registry.recipes import demonstrated_tasks
from robocasa_lerobot.data.registry.registry_file import (
    DEMONSTRATED,
    TASK,
    RegisteredDataset,
    RegistryConfig,
    load_registry,
)
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.jsonl import read_jsonl

_SHOWN = 20  # missing datasets that an error lists


def make_remedy(experiment: str = "EXPERIMENT_FILE") -> str:
    """How to make a dataset that our demonstrators make, for an `experiment` file, with its settings."""
    return f"`robocasa-lerobot data {experiment} --make` records and converts it with our demonstrators"


MAKE = make_remedy()  # where the file is not known


class NothingRegisteredError(UserError):
    """A selection of a task set of which the registry has no task, because none is in this version yet."""


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


class Registry:
    """The datasets of a registry file, and the published ones if it says so."""

    def __init__(self, config: RegistryConfig) -> None:
        self.config = config
        self._read: dict[str, tuple[str, ...] | None] = {}  # tasks in datasets of which the registry does not say
        self.published = PublishedDatasets(Path(config.root)) if config.scheme == ROBOCASA365 else None

    @functools.cached_property
    def task_sets(self) -> dict[str, tuple[str, ...]]:
        """The benchmark's task sets, or what of them can be demonstrated, and the file's own, which win."""
        sets = published_task_sets()
        if self.config.only == DEMONSTRATED:
            there = demonstrated_tasks()
            sets = {name: tuple(task for task in tasks if task in there) for name, tasks in sets.items()}
        return {**sets, **{name: tuple(tasks) for name, tasks in self.config.task_sets.items()}}

    def lacking(self, task_set: str) -> tuple[int, int]:
        """How many of the tasks of one of the benchmark's sets are not in this version, and how many it has."""
        if task_set in self.config.task_sets or task_set not in published_task_sets():
            return 0, len(self.task_sets.get(task_set, ()))
        total = len(published_task_sets()[task_set])
        return total - len(self.task_sets[task_set]), total

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
        listed = self._tasks_of(dataset)
        known: dict[Path, str | None] = {}
        for task in tasks if listed is None else [task for task in tasks if task in listed]:
            root = Path(self.config.root) / dataset.path.replace(TASK, task)
            if root not in known:
                known[root] = self._missing(dataset, root)
            filtered = TASK not in dataset.path and (listed is None or len(listed) > 1)
            yield DatasetEntry(task, dataset.split, dataset.source, root, known[root], filtered, dataset)

    def _missing(self, dataset: RegisteredDataset, root: Path) -> str | None:
        """What to do about a dataset of the file that is not there."""
        version = dataset_version(root)
        if version == "v3.0":
            return None
        what = f"LeRobotDataset {version} there, v3.0 is needed" if version else "nothing there"
        place = Path(self.config.root) / dataset.path  # the same words for all tasks, so that they are said once
        remedy = dataset.get or "correct the `path` in the registry, or convert it"
        return f"{place}: {what}; {MAKE if dataset.make else remedy}"

    def _tasks_of(self, dataset: RegisteredDataset) -> tuple[str, ...] | None:
        """The dataset's tasks; None if the registry does not say and the dataset cannot."""
        if dataset.tasks is not None:
            return tuple(dataset.tasks)
        if dataset.task_set is not None:
            if dataset.task_set not in self.task_sets:
                raise UnknownNameError("task set", dataset.task_set, self.task_sets, f"(of dataset {dataset.path})")
            return self.task_sets[dataset.task_set]
        from robocasa_lerobot.data.reading.source import (
            EPISODE_TABLE,  # with torch, which a list of task sets needs not
        )

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
    return Registry(load_registry(path))


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
        lacking, total = registry.lacking(selection.task_set)
        if total and lacking == total and not tasks:
            raise NothingRegisteredError(f"none of the {total} tasks of {selection.task_set} is in this version yet.")
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
            if member.repo_id is not None:
                remedy = f"training fetches {member.repo_id} from the hub to {member.root}"
            tasks = "+".join(member.tasks or ["all tasks"])
            entries.append(DatasetEntry(tasks, "-", "member", Path(member.root), remedy))
    return entries


def registered_part(config: MixtureConfig) -> tuple[MixtureConfig | None, list[str]]:
    """The mixture without selections of which no task is in this version, and the missing tasks of the others.

    The mixture is None where nothing is left. The sentences are the same whether or not datasets are there.

    Raises:
        UserError: as `select_datasets`.
    """
    kept: list[SelectionConfig] = []
    said: list[str] = []
    for selection in config.select:
        try:
            select_datasets(selection)
        except NothingRegisteredError as error:
            said.append(str(error))
            continue
        kept.append(selection)
        if selection.task_set is not None:
            lacking, total = open_registry(selection.registry).lacking(selection.task_set)
            if lacking:
                said.append(f"{total - lacking} of the {total} tasks of {selection.task_set} are in this version.")
    said = list(dict.fromkeys(said))
    if not kept and not config.members:
        return None, said
    groups = {member.group for member in config.members} | {selection.group for selection in kept}
    shares = config.shares and {group: share for group, share in config.shares.items() if group in groups}
    return dataclasses.replace(config, select=kept, shares=shares), said


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
                    frames=selection.frames,
                )
            )
    return dataclasses.replace(config, members=members, select=[])


def _tasks_in(table: Path) -> tuple[str, ...] | None:
    """Names of the tasks in the table of episodes of a converted dataset, if it has one."""
    if not table.is_file():
        return None
    return tuple(sorted({str(row["task_name"]) for row in read_jsonl(table)}))
