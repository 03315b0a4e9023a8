"""What the runs of a report lack: tasks and trials that were not run, and what a training left out."""

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
    """Whether any of a policy's runs lacks tasks that its protocol names, or trials that it planned."""
    lacks_tasks = any(tasks or by_set for _, tasks, by_set in lacking(policy))
    return lacks_tasks or any(_unfinished(part) is not None for part in policy.parts or (policy,))


def partial_runs(data: ReportData) -> str | None:
    """Which policies were not run on all tasks of their protocols or in all planned trials, and what they lack."""
    labels: dict[str, list[str]] = {}
    for policy in data.single:
        said = [partial_sentence(*lacks) for lacks in lacking(policy)]
        for sentence in dict.fromkeys((*said, _unfinished(policy))):
            if sentence is not None:
                labels.setdefault(sentence, []).append(policy.label)
    if data.not_begun:
        labels["planned, and none of its trials is recorded."] = list(data.not_begun)
    return " ".join(f"{_some(names)}: {sentence}" for sentence, names in labels.items()) or None


def lacking(policy: PolicyResult) -> list[tuple[dict[str, list[str]], list[str], dict[str, list[str]]]]:
    """Of each of a policy's runs: its task sets with the tasks that were run, the tasks that no run of its has, and
    the same by set.

    What one run left out a later one in the same folder may have.
    """
    run = {result.task for results in policy.conditions.values() for result in results}
    found = []
    for header in policy.headers:
        by_set = {name: [t for t in tasks if t not in run] for name, tasks in header.missing_by_set.items()}
        sets = {
            name: [*header.task_sets.get(name, ()), *(t for t in header.missing_by_set.get(name, ()) if t in run)]
            for name in {**header.task_sets, **header.missing_by_set}
        }
        missing = [task for task in header.missing_tasks if task not in run]
        found.append((sets, missing, {name: tasks for name, tasks in by_set.items() if tasks}))
    return found


def _unfinished(policy: PolicyResult) -> str | None:
    """How many of the planned trials of a run that was killed, or still goes on, are recorded; None where all are."""
    recorded = {(name, r.task): r.trials for name, results in policy.conditions.items() for r in results}
    done = {key: sum(r.trial < count for r in recorded.get(key, ())) for key, count in policy.planned.items()}
    planned, tasks = sum(policy.planned.values()), {task for _, task in policy.planned}
    if sum(done.values()) == planned:
        return None
    none = len(tasks - {task for (_, task), count in done.items() if count})
    without = f", and {none} of {fmt.count(len(tasks), 'task')} {'has' if none == 1 else 'have'} none" if none else ""
    return (
        f"unfinished: {sum(done.values()):,} of {fmt.count(planned, 'planned trial')} are recorded{without}; the "
        "command that made it goes on where it stopped."
    )


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
