"""The schema of `trials.jsonl`: one line for each trial, written and read by this module only."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.evaluation.plan import TrialKey

TRIALS_FILE = "trials.jsonl"
SCHEMA_VERSION = 1


class ResultsError(UserError):
    """A results file that this version cannot read, or that belongs to other settings."""


@dataclass(frozen=True)
class TrialRecord:
    """What happened in one trial, and every setting that made it.

    `steps` are control steps at 20 Hz. `success` is reached at any step of the episode. `success_terms` are the
    task's goal predicates at the last step, `terms_ever` whether each held at any step. `error` is the traceback
    of a trial that crashed or hung twice; such a trial counts as a failure and is shown as an error. `retried_error`
    is the one of the first attempt. `trajectory` is a SHA-256 over all actions and proprioception.
    """

    label: str
    task: str
    trial: int
    seed: int
    policy_seed: int
    success: bool
    steps: int
    horizon: int | None
    first_success_step: int | None
    success_terms: dict[str, bool]
    terms_ever: dict[str, bool]
    instruction: str
    scene: dict[str, Any]
    trajectory: str | None
    video: str | None
    wall_seconds: float
    attempts: int
    error: str | None
    retried_error: str | None
    policy: dict[str, Any]
    settings: dict[str, Any]
    versions: dict[str, str]
    git_commit: str | None
    finished: str
    schema: int = field(default=SCHEMA_VERSION)

    @property
    def key(self) -> TrialKey:
        """What identifies the trial in a results file."""
        return (self.label, self.task, self.trial)

    def to_line(self) -> str:
        """The JSON line of this record, without its newline."""
        return json.dumps(dataclasses.asdict(self), ensure_ascii=False, allow_nan=False)

    @classmethod
    def from_line(cls, line: str, where: str) -> TrialRecord:
        """The record of a JSON line; `where` names file and line number for errors.

        Raises:
            ResultsError: not JSON, another schema version, or a missing, unknown or wrongly typed key.
        """
        try:
            values = json.loads(line)
        except json.JSONDecodeError as error:
            raise ResultsError(
                f"{where}: not a JSON object ({error}). Remove the line, or restore the file."
            ) from error
        if not isinstance(values, dict):
            raise ResultsError(f"{where}: found {type(values).__name__}, expected a JSON object.")
        if values.get("schema") != SCHEMA_VERSION:
            found = values.get("schema")
            raise ResultsError(f"{where}: schema {found!r}, this version reads {SCHEMA_VERSION}; evaluate again.")
        names = [f.name for f in dataclasses.fields(cls)]
        for name in values:
            if name not in names:
                raise ResultsError(f"{where}: unknown key {name!r}. {suggest(name, names)}")
        missing = [name for name in names if name not in values]
        if missing:
            raise ResultsError(f"{where}: missing key(s) {', '.join(missing)}.")
        for name, kind in _CHECKED_TYPES.items():
            # bool is an int in Python; a success of 1 or a trial of True is a mistake of the writer.
            if type(values[name]) is not kind:
                raise ResultsError(f"{where}: {name!r} is {values[name]!r}, expected {kind.__name__}.")
        return cls(**values)


_CHECKED_TYPES: dict[str, type] = {
    "label": str,
    "task": str,
    "trial": int,
    "seed": int,
    "success": bool,
    "steps": int,
    "success_terms": dict,
    "terms_ever": dict,
    "policy": dict,
    "settings": dict,
}


def read_trials(path: Path) -> list[TrialRecord]:
    """The records of a `trials.jsonl`; of several with the same key the last one counts.

    A last line without its newline is a write that was cut off by a kill: it is left out, so that its trial runs again.

    Raises:
        ResultsError: the file is missing or a complete line is not a record.
    """
    if not path.is_file():
        raise ResultsError(f"{path}: no such file; expected the {TRIALS_FILE} of an evaluation.")
    records: dict[TrialKey, TrialRecord] = {}
    complete = path.read_bytes().split(b"\n")[:-1]
    for number, line in enumerate(complete, start=1):
        if line.strip():
            record = TrialRecord.from_line(line.decode("utf-8", errors="replace"), f"{path}:{number}")
            records[record.key] = record
    return list(records.values())


def drop_torn_line(path: Path) -> int:
    """Cut off a last line without newline; the number of bytes removed (0: the file was whole or is missing)."""
    if not path.is_file():
        return 0
    data = path.read_bytes()
    keep = data.rfind(b"\n") + 1
    if keep < len(data):
        with path.open("r+b") as file:
            file.truncate(keep)
            os.fsync(file.fileno())
    return len(data) - keep


def append_trial(path: Path, record: TrialRecord) -> None:
    """Append one record, with one write to the end of the file and a sync, so that a kill leaves it whole or torn."""
    line = (record.to_line() + "\n").encode()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        written = os.write(descriptor, line)
        if written != len(line):
            raise OSError(f"{path}: wrote {written} of {len(line)} bytes; is the disk full?")
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def check_same_run(
    path: Path, records: Iterable[TrialRecord], policies: dict[str, dict[str, Any]], settings: dict[str, Any]
) -> None:
    """Refuse to mix trials of different settings or checkpoints in one results file.

    Args:
        path: the results file, for the message.
        records: what it holds.
        policies: label -> policy description (`fingerprint` decides) of the run that is about to start.
        settings: settings of the run that is about to start; all records must have exactly these.

    Raises:
        ResultsError: a setting or a checkpoint differs; all differences are named.
    """
    differences: dict[str, None] = {}
    for record in records:
        for name in sorted({*settings, *record.settings}):
            old, new = record.settings.get(name), settings.get(name)
            if old != new:
                differences[f"{name}: {old!r} in the file, {new!r} now"] = None
        if record.label in policies:
            old, new = record.policy.get("fingerprint"), policies[record.label]["fingerprint"]
            if old != new:
                differences[f"policy {record.label!r}: weights {str(old)[:12]} in the file, {str(new)[:12]} now"] = None
    if differences:
        raise ResultsError(
            f"{path} holds trials made with other settings:\n  " + "\n  ".join(differences) + "\n"
            "Trials of different settings are never mixed: choose another --out (or --policy.label for another "
            "checkpoint), or go back to the settings of the file."
        )
