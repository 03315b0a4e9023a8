"""Which datasets an experiment needs, what of them is there, and how many demonstrations our recipes would record."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.data.mixture_config import MixtureConfig
from robocasa_lerobot.data.registry.published import DEMONSTRATIONS, FEWER, DatasetEntry, dataset_version
from robocasa_lerobot.data.registry.registry import Registry, missing_datasets, open_registry, select_datasets
from robocasa_lerobot.data.registry.registry_file import TASK, RegisteredDataset
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.training.config.experiment import ExperimentConfig
from robocasa_lerobot.training.planning.skipped import Skipped
from robocasa_lerobot.training.planning.unavailable import runnable

WORK = ".making"  # in the root of a registry: recordings and logs of datasets that are being made


@dataclass(frozen=True)
class Content:
    """What of a dataset is there: demonstrations, steps and bytes on disk."""

    episodes: int
    frames: int
    size: int


@dataclass(frozen=True)
class Need:
    """A dataset that an experiment needs.

    Attributes:
        group: what it is listed under: the `path` of a registry, or split and source of published data.
        task, split, source: its contents.
        root: its folder.
        missing: what to do if it is not there; None where it is.
        demonstrations: how many there should be; None where nobody says.
        made: how our demonstrators make it, if they do.
        registry_root: folder of the registry that it is from.
        redrawn: the dataset whose episodes are drawn again for it, if it is made so.
        policy: folder of the phase whose policy is corrected for it, if it is made so.
        waits: whether that phase has not ended yet.
    """

    group: str
    task: str
    split: str
    source: str
    root: Path
    missing: str | None
    demonstrations: int | None = None
    made: RegisteredDataset | None = None
    registry_root: Path = Path()
    redrawn: Path | None = None
    policy: Path | None = None
    waits: bool = False

    @property
    def work(self) -> Path:
        """Folder for its recordings, and for the log."""
        return self.registry_root / WORK / self.root.relative_to(self.registry_root)

    def content(self) -> Content | None:
        """The dataset, if it is there."""
        if dataset_version(self.root) != "v3.0":
            return None
        info = json.loads((self.root / "meta/info.json").read_text(encoding="utf-8"))
        size = sum(file.stat().st_size for file in self.root.rglob("*") if file.is_file())
        return Content(int(info["total_episodes"]), int(info["total_frames"]), size)


def needs_of(
    experiment: ExperimentConfig, episodes: Mapping[str, int] | None = None, phase: str | None = None
) -> tuple[list[Need], list[Skipped]]:
    """The datasets of all phases that can run, or of one, each once, and the phases left out or partial.

    Args:
        experiment: the one to train.
        episodes: demonstrations of each kind of dataset, over those that the registries say.
        phase: its name, where it is to be the only one.

    Raises:
        UnknownNameError: there is no such phase.
        UserError: a selection does not fit its registry, or `episodes` has a kind that none of them has.
    """
    part, said = runnable(experiment)
    asked = {one.name for one in experiment.phases} if phase is None else {experiment.phase(phase).name}
    found: dict[tuple[Path, str, str, str], Need] = {}  # missing published data has no folders yet
    kinds: set[str] = set()
    for mixture in [one.mixture for one in part.phases if one.name in asked]:
        for selection in mixture.select:
            registry = open_registry(selection.registry)
            kinds |= set(registry.config.episodes)
            numbers = {**registry.config.episodes, **(episodes or {})}
            for entry in select_datasets(selection):
                for need in _needs_of_entry(entry, registry, numbers):
                    need = _with_policy(need, experiment)
                    found.setdefault((need.root, need.task, need.split, need.source), need)
        alone = MixtureConfig(members=mixture.members) if mixture.members else None
        lacking = {entry.root: entry for entry in missing_datasets(alone)} if alone else {}
        for member in mixture.members:
            root = Path(member.root)
            tasks = "+".join(member.tasks or ["all tasks"])
            missing = lacking[root].missing if root in lacking else None
            need = Need(str(root), tasks, "-", "member", root, missing)
            found.setdefault((root, tasks, "-", "member"), need)
    unknown = sorted(set(episodes or ()) - kinds)
    if unknown and kinds:
        raise UnknownNameError("kind of dataset", unknown[0], kinds, "(in --episodes)")
    if unknown:
        raise UserError("--episodes is of datasets that our demonstrators make; this experiment has none.")
    return list(found.values()), said


def _needs_of_entry(entry: DatasetEntry, registry: Registry, numbers: Mapping[str, int]) -> list[Need]:
    """The need of a registry's entry; before it, that of the dataset that is drawn again for it."""
    dataset, root = entry.registered, Path(registry.config.root)
    if dataset is None:
        group, kind = f"published {entry.split}, {entry.source}", (entry.split, entry.source)
        count = FEWER.get((*kind, entry.task), DEMONSTRATIONS.get(kind))
        return [Need(group, entry.task, entry.split, entry.source, entry.root, entry.missing, count, None, root)]
    need = Need(dataset.path, entry.task, dataset.split, dataset.source, entry.root, entry.missing, registry_root=root)
    if dataset.make is None:
        return [need]
    need = dataclasses.replace(need, demonstrations=numbers[dataset.make.episodes], made=dataset)
    if dataset.make.redraw is None:
        return [need]
    source = _dataset_of_path(registry.config.datasets, dataset.make.redraw)
    found = registry.find([entry.task], source.split, source.source, source.views)
    before = [other for other in found if other.registered == source]  # others may hold the same kind of data
    if not before:
        raise UserError(
            f"{dataset.path}: its recipe draws {source.path} again, which has no {entry.task}; give both the same."
        )
    return [
        *_needs_of_entry(before[0], registry, numbers),
        dataclasses.replace(need, redrawn=before[0].root),
    ]


def _with_policy(need: Need, experiment: ExperimentConfig) -> Need:
    """A need with the place of the policy that is corrected for it, where it is made so."""
    recipe = None if need.made is None else need.made.make
    if recipe is None or recipe.corrects is None:
        return need
    from robocasa_lerobot.training.weights.checkpoint import checkpoint_step, last_checkpoint  # with torch

    phase = experiment.phase(recipe.corrects)
    folder = Path(experiment.output_dir) / phase.name
    last = last_checkpoint(folder)
    return dataclasses.replace(need, policy=folder, waits=last is None or checkpoint_step(last) < phase.steps)


def _dataset_of_path(datasets: Sequence[RegisteredDataset], path: str) -> RegisteredDataset:
    for dataset in datasets:
        if dataset.path == path and dataset.make is not None and TASK in path:
            return dataset
    raise UnknownNameError("dataset", path, [dataset.path for dataset in datasets], "(`redraw` of a recipe)")


def parse_episodes(text: str) -> dict[str, int]:
    """`human=20,mg=40` as numbers by kind.

    Raises:
        UserError: it is written otherwise, or a number is below 1.
    """
    out: dict[str, int] = {}
    for part in text.split(","):
        kind, equals, number = part.strip().partition("=")
        if not (kind and equals and number.strip().isdigit() and int(number) > 0):
            raise UserError(f"--episodes: {part!r} is not KIND=NUMBER, as in human=20,mg=40,target=20.")
        out[kind] = int(number)
    return out
