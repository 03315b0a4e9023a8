"""Writing `trials.jsonl`: whole lines at its end, what a kill left behind, and never two settings in one file."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from robocasa_lerobot.evaluation.records.results import ResultsError, RunHeader, TrialRecord

# Other versions of these may let the same trial take another course.
_DECIDING_VERSIONS = ("robocasa_lerobot", "mujoco")
# Other versions of these may compute a policy's actions with other last bits, or otherwise.
_COMPUTING_VERSIONS = ("lerobot", "torch", "onnxruntime")
# Settings that follow from the checkpoints of a run, and say nothing of one without any.
_OF_CHECKPOINTS = ("device", "batch_width", "runtime")


def append(path: Path, item: RunHeader | TrialRecord) -> None:
    """Append one line, with one write to the end of the file and a sync, so that a kill leaves it whole or torn."""
    line = (item.to_line() + "\n").encode()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        written = os.write(descriptor, line)
        if written != len(line):
            raise OSError(errno.ENOSPC, f"wrote {written} of {len(line)} bytes", str(path))
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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


def differences(old: RunHeader, new: RunHeader) -> list[str]:
    """What keeps the trials of two runs apart, a sentence each: settings, versions, or weights behind one label."""
    found = []
    flat_old, flat_new = _flat(old.settings), _flat(new.settings)
    left_out = () if old.has_checkpoints and new.has_checkpoints else _OF_CHECKPOINTS
    for name in dict.fromkeys((*flat_old, *flat_new)):
        before, now = flat_old.get(name), flat_new.get(name)
        if before != now and name not in left_out:
            found.append(f"{name}: {before!r} in the file, {now!r} now")
    for name in _DECIDING_VERSIONS:
        before, now = old.versions.get(name), new.versions.get(name)
        if before != now:
            found.append(f"version of {name}: {before} in the file, {now} now")
    for label in old.policies.keys() & new.policies.keys():
        before, now = old.policies[label].fingerprint, new.policies[label].fingerprint
        if before != now:
            what = "weights" if old.policies[label].remote is None else "key map or server's metadata"
            found.append(f"policy {label!r}: {what} {_short(before)} in the file, {_short(now)} now")
    return found


def _short(fingerprint: str) -> str:
    kind, colon, digits = fingerprint.rpartition(":")
    return kind + colon + digits[:12]


def check_same_run(path: Path, headers: Iterable[RunHeader], new: RunHeader) -> None:
    """Refuse to mix trials of different settings or checkpoints in one results file; say it of different commits, and
    of other versions of what computes policies.

    Raises:
        ResultsError: a setting, a deciding version or a checkpoint differs; all differences are named.
    """
    earlier = list(headers)
    found = dict.fromkeys(line for old in earlier for line in differences(old, new))
    if found:
        raise ResultsError(
            f"{path} holds trials made with other settings:\n  " + "\n  ".join(found) + "\n"
            "Trials of different settings are never mixed: choose another --out (or --policy.label for another "
            "checkpoint), or go back to the settings of the file."
        )
    # A warning only: most commits change no outcome, and which do nobody can tell from here.
    for commit in dict.fromkeys(old.git_commit for old in earlier):
        if commit != new.git_commit:
            print(
                f"{path} holds trials made at commit {commit or 'unknown'} of this package, and it is now at "
                f"{new.git_commit or 'unknown'}: if trials take another course since, choose another --out.",
                file=sys.stderr,
            )
    # As for commits: most versions change last bits at most.
    for before, now in dict.fromkeys(_other_versions(old, new) for old in earlier):
        if before:
            print(
                f"{path} holds trials of policies computed with {before}, and it is now {now}: if they act otherwise "
                "since, choose another --out.",
                file=sys.stderr,
            )


def _other_versions(old: RunHeader, new: RunHeader) -> tuple[str, str]:
    """What the checkpoints of two runs are computed with, as far as it differs and both say it."""
    if not (old.has_checkpoints and new.has_checkpoints):
        return "", ""
    both = [name for name in _COMPUTING_VERSIONS if name in old.versions and name in new.versions]
    other = [name for name in both if old.versions[name] != new.versions[name]]
    before, now = (", ".join(f"{name} {one.versions[name]}" for name in other) for one in (old, new))
    return before, now


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict) and value:
            out |= _flat(value, f"{prefix}{name}.")
        else:
            out[prefix + name] = value
    return out
