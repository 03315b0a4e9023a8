"""Recordings on a Slurm cluster or on Ray, through datatrove, as conversions run there: a job for each task."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from robocasa_lerobot.demos.recording import RecordingSettings, record_tasks
from robocasa_lerobot.demos.summary import print_summary
from robocasa_lerobot.jobs.executors import Execution, submit_to_slurm
from robocasa_lerobot.jobs.ray import run_with_ray

_FOLDER, _LOGS = ".executor", "slurm"


def record_one(
    data: Any,
    rank: int = 0,
    world_size: int = 1,
    *,
    settings: Sequence[RecordingSettings],
    out: Path,
    workers: int,
    keep_failures: bool,
) -> None:
    """Record one of the tasks, in datatrove's calling convention."""
    record_tasks([settings[rank]], out, workers=workers, keep_failures=keep_failures)


def finish(settings: Sequence[RecordingSettings], out: Path, keep_failures: bool) -> int:
    """Print the table of what the jobs recorded; tasks that were given up say so at once."""
    return print_summary(record_tasks(settings, out, keep_failures=keep_failures, show_progress=False))


def record_distributed(
    settings: Sequence[RecordingSettings], out: Path, execution: Execution, *, keep_failures: bool
) -> tuple[str, int]:
    """Record all tasks with Ray, or submit them to Slurm; a line for the user where it does not wait, and a status.

    Raises:
        UserError: the executor is not there, Slurm refuses, or what a recording itself raises.
    """
    assert execution.kind in ("slurm", "ray")
    for one in settings:
        one.check()  # mistakes come up here, not in the first job
    asked = json.dumps([dataclasses.asdict(one) for one in settings])
    folder = out / _FOLDER / hashlib.sha256(asked.encode()).hexdigest()[:12]  # for these settings only
    folder.mkdir(parents=True, exist_ok=True)
    step = partial(record_one, settings=settings, out=out, workers=execution.cpus, keep_failures=keep_failures)
    last = partial(finish, settings, out, keep_failures)
    # Every task runs: markers outlive a file that is removed, and one that is there is left alone.
    if execution.kind == "ray":
        run_with_ray(step, len(settings), folder, execution.ray, skip_complete=False)
        return "", last()
    logs = out / _LOGS
    array, final = submit_to_slurm(step, last, len(settings), folder, logs, execution.slurm, skip_complete=False)
    told = f"submitted to Slurm: {len(settings)} tasks in job {array}, summed up by job {final}."
    return f"{told} What they print is in {logs}.", 0
