"""What came before an evaluation: learning curves of a training, and how often its demonstrator succeeded."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.report.policies import PolicyResult
from robocasa_lerobot.evaluation.statistics import Rate, success_rate


@dataclass(frozen=True)
class TrainingPhase:
    """The loss curve of a training phase."""

    name: str
    steps: tuple[int, ...]
    losses: tuple[float, ...]


@dataclass(frozen=True)
class Training:
    """A training's phases in order, and its settings as they were saved."""

    folder: Path
    phases: tuple[TrainingPhase, ...]
    experiment: str


@dataclass(frozen=True)
class DemonstratorResult:
    """How often the demonstrator that made the training data solved a task."""

    task: str
    rate: Rate


def find_trainings(policies: Sequence[PolicyResult]) -> list[Path]:
    """Output folders of the trainings that the evaluated checkpoints lie in, if they are still there."""
    found: dict[Path, None] = {}
    for policy in policies:
        if policy.info.phase is not None:
            # <experiment>/<phase>/checkpoints/<step>/pretrained_model
            above = Path(policy.info.path).resolve().parents
            if len(above) > 3 and any(above[3].glob("*/metrics.jsonl")):
                found[above[3]] = None
    return list(found)


def read_training(folder: Path) -> Training:
    """Loss curves of a training's phases, in the order of its experiment file where it has one.

    Raises:
        UserError: no `metrics.jsonl` in the folder or one level below, or a damaged one.
    """
    files = sorted([*folder.glob("metrics.jsonl"), *folder.glob("*/metrics.jsonl")], key=lambda p: p.stat().st_mtime)
    if not files:
        raise UserError(f"{folder}: no metrics.jsonl there or one level below; expected the output of a training.")
    experiment_file = folder / "experiment.yaml"
    experiment = experiment_file.read_text(encoding="utf-8") if experiment_file.is_file() else ""
    return Training(folder, tuple(_read_phase(file) for file in files), experiment)


def _read_phase(path: Path) -> TrainingPhase:
    losses: dict[int, float] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").split("\n")[:-1], start=1):
        try:
            values = json.loads(line)
            if "loss" in values:
                losses[int(values["step"])] = float(values["loss"])
        except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
            raise UserError(f"{path}:{number}: not a line of training metrics ({error!r}).") from error
    steps = tuple(sorted(losses))
    return TrainingPhase(path.parent.name, steps, tuple(losses[step] for step in steps))


def read_demonstrator(path: Path) -> list[DemonstratorResult]:
    """Success rate of the demonstrator from the counts in an HDF5 file's `data` attributes; none if it has no counts.

    Raises:
        UserError: not an HDF5 file.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            attributes = dict(file["data"].attrs)
    except (OSError, KeyError) as error:
        raise UserError(f"{path}: not an HDF5 file of demonstrations ({error}).") from error
    if "episodes_tried" not in attributes:
        return []
    tried, failed = int(attributes["episodes_tried"]), int(attributes["episodes_failed"])
    return [DemonstratorResult(str(attributes["env"]), success_rate(tried - failed, tried))] if tried else []
