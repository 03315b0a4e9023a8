"""Where the pieces of a conversion run: processes of this machine, a Slurm cluster, or Ray; all are datatrove's.

On this machine and with Ray the command waits and then joins the pieces. With Slurm it submits an array of jobs, one
for each piece, and one job more that joins them when all have succeeded, and returns. In both cases a piece that is
complete stays complete: the same command goes on with the others.
"""

from __future__ import annotations

import argparse
import importlib.util
import pickle
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, get_type_hints

from robocasa_lerobot.errors import UserError

KINDS = ("local", "slurm", "ray")
JOBS_FILE = "jobs.json"
_FORGOTTEN = "Invalid job id"  # what squeue says of a job that ended some minutes ago
_UNQUOTED = re.compile(r"[^\w/.+@:,=~-]")  # means something to a shell, or to sbatch (%)


@dataclass(frozen=True)
class SlurmSettings:
    """Options `--slurm.NAME` of sbatch, for each piece of the work."""

    partition: str | None = field(default=None, metadata={"help": "partition to run in (needed)"})
    time: str | None = field(default=None, metadata={"help": "time limit of a piece, such as 02:00:00 (needed)"})
    jobs: int = field(default=-1, metadata={"help": "how many pieces may run at a time; -1 for no limit"})
    cpus: int = field(default=2, metadata={"help": "cores of a piece: one to read or render, one to encode"})
    mem_per_cpu_gb: int = field(default=4, metadata={"help": "memory for each core, GB"})
    gpus: int = field(default=0, metadata={"help": "GPUs of a piece, for rendering and policies"})
    account: str | None = field(default=None, metadata={"help": "account to charge"})
    qos: str | None = field(default=None, metadata={"help": "quality of service"})
    env_command: str | None = field(
        default=None, metadata={"help": "shell command before each piece (default: put this Python first in PATH)"}
    )
    max_array_size: int = field(default=1001, metadata={"help": "the cluster's limit of an array"})


@dataclass(frozen=True)
class RaySettings:
    """Options `--ray.NAME`, for each piece of the work."""

    jobs: int = field(default=-1, metadata={"help": "how many pieces may run at a time; -1 for no limit"})
    cpus: int = field(default=2, metadata={"help": "cores of a piece"})
    mem_per_cpu_gb: int = field(default=4, metadata={"help": "memory for each core, GB"})
    gpus: int = field(default=0, metadata={"help": "GPUs of a piece, for rendering and policies"})


@dataclass(frozen=True)
class Execution:
    """How the pieces are run.

    Raises:
        UserError: an executor that this machine does not have, or one without what it needs.
    """

    kind: str = "local"
    workers: int | None = None  # processes on this machine; None: by the amount of work
    slurm: SlurmSettings = SlurmSettings()
    ray: RaySettings = RaySettings()

    def __post_init__(self) -> None:
        assert self.kind in KINDS, self.kind
        if self.workers is not None and self.kind != "local":
            raise UserError(f"--workers is for this machine; with --executor {self.kind} give --{self.kind}.jobs.")
        if self.kind == "slurm":
            missing = [f"--slurm.{name}" for name in ("partition", "time") if getattr(self.slurm, name) is None]
            if missing:
                raise UserError(f"--executor slurm needs {' and '.join(missing)} (sinfo lists the partitions).")
            if shutil.which("sbatch") is None:
                raise UserError(
                    "--executor slurm: no `sbatch` was found on this machine. Give the command on a login node of the "
                    "cluster, or leave --executor out to run here."
                )
        if self.kind == "ray" and importlib.util.find_spec("ray") is None:
            raise UserError(
                "--executor ray: the Python package `ray` is not installed. Install it into this environment "
                f"({sys.prefix}) with `pip install ray`, or leave --executor out to run here."
            )

    @property
    def cpus(self) -> int:
        """Cores of a piece on Slurm or Ray."""
        assert self.kind != "local", "pieces on this machine have no cores of their own"
        return self.ray.cpus if self.kind == "ray" else self.slurm.cpus


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add `--executor` and the options of each."""
    parser.add_argument("--executor", choices=KINDS, default="local", help="where to run (default: this machine)")
    for kind, settings in (("slurm", SlurmSettings), ("ray", RaySettings)):
        group = parser.add_argument_group(f"options of --executor {kind}")
        hints = get_type_hints(settings)
        for option in fields(settings):
            group.add_argument(
                f"--{kind}.{option.name}",
                type=int if hints[option.name] is int else str,
                default=option.default,
                metavar=option.name.upper(),
                help=option.metadata["help"] + ("" if option.default is None else " (default: %(default)s)"),
            )


def check_options(args: argparse.Namespace) -> None:
    """Refuse options of an executor that is not asked for: the work would run on this machine without a word.

    Raises:
        UserError: such an option was given, and the command runs something.
    """
    if getattr(args, "merge", False):  # runs nothing: the same command as before, with another last word
        return
    given = vars(args)
    for kind, settings in (("slurm", SlurmSettings), ("ray", RaySettings)):
        names = [option.name for option in fields(settings) if given[f"{kind}.{option.name}"] != option.default]
        if names and args.executor != kind:
            where = "on this machine" if args.executor == "local" else f"on {args.executor.capitalize()}"
            raise UserError(
                f"--{kind}.{names[0]} is for --executor {kind}, and the command would run {where}. Give --executor "
                f"{kind} too, or leave --{kind}.{names[0]} out."
            )


def execution_of(args: argparse.Namespace) -> Execution:
    """What the options of `add_options` (and `--workers`) ask for."""
    given = vars(args)

    def chosen(kind: str, settings: Any) -> Any:
        return settings(**{option.name: given[f"{kind}.{option.name}"] for option in fields(settings)})

    return Execution(args.executor, args.workers, chosen("slurm", SlurmSettings), chosen("ray", RaySettings))


def submit_to_slurm(
    step: Callable[..., None],
    finish: Callable[[], object],
    pieces: int,
    folder: Path,
    logs: Path,
    slurm: SlurmSettings,
    *,
    skip_complete: bool = True,
) -> tuple[str | None, str]:
    """Submit the pieces that are not complete, and a job that calls `finish` when all of them have succeeded.

    Args:
        step: datatrove's step for one piece.
        finish: called in the last job; pickled.
        pieces: their number.
        folder: for completion markers and the pickled pipeline, on a file system that the nodes share.
        logs: folder for what the jobs print, and the record of them.
        slurm: what to ask Slurm for.
        skip_complete: False submits all pieces, for steps that find out themselves what is left of theirs.

    Returns:
        Numbers of the arrays of jobs, with commas (None where all pieces are complete), and of the last job.

    Raises:
        UserError: jobs of an earlier call are still in the queue, or Slurm refuses.
    """
    from robocasa_lerobot.jobs.slurm import ArrayExecutor, JobRecord, NotedError, read_record

    record = logs / JOBS_FILE  # not in the folder of the work, which the last job removes
    if record.is_file():
        waiting = _queued(read_record(record), record)
        if waiting:
            raise UserError(
                f"the jobs of this work are still in the queue: {', '.join(waiting)}. Wait until they end (squeue), or "
                "cancel them (scancel) and give the same command again."
            )
    found = {sign for path in (folder, logs) for sign in _UNQUOTED.findall(str(path.absolute()))}
    if found:
        shown = " ".join(map(repr, sorted(found)))
        raise UserError(
            f"{folder.parent}: datatrove's job files do not quote paths, and this one has {shown}. "
            "Choose one of letters, digits and / . _ - + @ : , = ~ alone."
        )
    folder.mkdir(parents=True, exist_ok=True)
    logs.mkdir(parents=True, exist_ok=True)
    taken = JobRecord(record)
    executor = ArrayExecutor(
        pipeline=[step],
        tasks=pieces,
        logging_dir=str(folder),
        skip_completed=skip_complete,
        job_id_retriever=taken,
        slurm_logs_folder=str(logs),
        time=slurm.time,
        partition=slurm.partition,
        workers=slurm.jobs,
        cpus_per_task=slurm.cpus,
        mem_per_cpu_gb=slurm.mem_per_cpu_gb,
        gpus_per_task=slurm.gpus,
        qos=slurm.qos,
        srun_args={"cpus-per-task": slurm.cpus},  # since Slurm 22.05 srun does not ask for what its job has
        sbatch_args={"account": slurm.account} if slurm.account else {},
        env_command=slurm.env_command or f"export PATH={shlex.quote(str(Path(sys.prefix) / 'bin'))}:$PATH",
        max_array_size=slurm.max_array_size,
        job_name="robocasa-lerobot",
        mail_type="NONE",
    )
    pickled = folder / "finish.pickle"
    pickled.write_bytes(pickle.dumps(finish))
    try:
        executor.run()
        arrays = [] if executor.job_id == -1 else list(taken.jobs)
        command = [sys.executable, "-m", "robocasa_lerobot.jobs.slurm", str(pickled)]
        last = executor.submit_after(arrays, shlex.join(command))
    except NotedError as error:
        raise UserError(
            f"Slurm took job {', '.join(taken.jobs)}, but {record} could not be written ({error}). Cancel what runs "
            f"(scancel {' '.join(taken.jobs)}), free disk space, and give the same command again."
        ) from error
    except (subprocess.CalledProcessError, OSError) as error:
        raise UserError(f"Slurm did not take the jobs: {error}. Its message stands above.") from error
    return ",".join(arrays) or None, last


def _queued(jobs: list[str], record: Path) -> list[str]:
    """Those of the jobs that Slurm still has to run or runs.

    Raises:
        UserError: Slurm does not answer.
    """
    if shutil.which("squeue") is None:
        return []
    waiting = []
    for job in jobs:
        done = subprocess.run(["squeue", "--noheader", "--jobs", job], capture_output=True, text=True, check=False)
        if done.returncode and _FORGOTTEN not in done.stderr:
            raise UserError(
                f"squeue does not say whether jobs of an earlier call still run ({done.stderr.strip()}). Give the same "
                f"command again when it answers, or remove {record} if none of {', '.join(jobs)} does."
            )
        if not done.returncode and done.stdout.strip():
            waiting.append(job)
    return waiting
