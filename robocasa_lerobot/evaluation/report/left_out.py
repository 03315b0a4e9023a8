"""What the runs of a report lack: tasks that were not run, and phases and evaluations that a training left out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.planning.run_header import partial_sentence
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Section
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData

SKIPPED_FILE = "skipped.jsonl"  # that a training writes into its output folder
_SHOWN = 3


def is_partial(policy: PolicyResult) -> bool:
    """Whether any of a policy's runs lacks tasks that its protocol names."""
    return any(header.missing_tasks or header.missing_by_set for header in policy.headers)


def partial_runs(data: ReportData) -> str | None:
    """Which policies were not run on all tasks of their protocols, and what they lack."""
    labels: dict[str, list[str]] = {}
    for policy in data.single:
        for header in policy.headers:
            said = partial_sentence(header.task_sets, header.missing_tasks, header.missing_by_set)
            if said is not None and policy.label not in labels.setdefault(said, []):
                labels[said].append(policy.label)
    return " ".join(f"{_some(names)}: {said}" for said, names in labels.items()) or None


def sentence(data: ReportData) -> str | None:
    """That something was left out, with the first of it."""
    found = lines(data)
    if not found:
        return None
    rest = "" if len(found) <= _SHOWN else f" All {len(found)} are listed under “What was left out”."
    return " ".join(found[:_SHOWN]) + rest


def section(data: ReportData) -> Section | None:
    """All that the trainings of these policies left out; None where that is nothing."""
    found = lines(data)
    text = ("Phases and evaluations of the trainings behind these policies that were left out, or failed.", *found)
    return Section("left-out", "What was left out", text) if found else None


def lines(data: ReportData) -> list[str]:
    """A sentence for each phase and evaluation that is left out, as far as the trainings' folders are there.

    Raises:
        UserError: a `skipped.jsonl` that cannot be read.
    """
    folders: dict[Path, str] = {}
    for policy in data.single:
        for folder in _output_folders(policy):
            if (folder / SKIPPED_FILE).is_file():
                folders.setdefault(folder, policy.info.experiment or folder.name)
    return [f"{name}: {line}" for folder, name in folders.items() for line in _read(folder / SKIPPED_FILE)]


def _output_folders(policy: PolicyResult) -> Iterator[Path]:
    """Where a training's output may be: above its evaluations, and above its checkpoints."""
    above = policy.folder.resolve().parents  # <output>/<phase>/evaluations/<name>
    if len(above) > 2 and above[0].name == "evaluations":
        yield above[2]
    above = Path(policy.info.path).resolve().parents  # <output>/<phase>/checkpoints/<step>/pretrained_model
    if len(above) > 3 and above[1].name == "checkpoints":
        yield above[3]


def _read(path: Path) -> Iterator[str]:
    for number, text in enumerate(path.read_text(encoding="utf-8").rstrip("\n").split("\n"), start=1):
        try:
            item = json.loads(text)
            kind, phase, evaluation, reason = (item[key] for key in ("kind", "phase", "evaluation", "reason"))
        except (ValueError, KeyError, TypeError) as error:
            raise UserError(f"{path}:{number}: not a line of what was left out ({error!r}).") from error
        if kind == "partial" and evaluation is not None:
            continue  # its run says so itself
        what = f"phase {phase}" if evaluation is None else f"evaluation {evaluation} of phase {phase}"
        yield f"{what} {'is partial' if kind == 'partial' else 'is left out'}: {str(reason).rstrip('.')}."


def _some(labels: Sequence[str]) -> str:
    if len(labels) <= _SHOWN:
        return fmt.listed(list(labels))
    return f"{', '.join(labels[:_SHOWN])} and {len(labels) - _SHOWN} more"
