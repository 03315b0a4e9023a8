"""Datasets made one after the other by several processes: on this machine, on a Slurm cluster, or with Ray.

A piece is one dataset, or one and the datasets drawn again from it. What a piece cannot make it says in a file, and the
others go on. Nothing but the datasets themselves says how far it is, so the same command takes up the rest.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jobs.executors import Execution, submit_to_slurm
from robocasa_lerobot.jobs.pool import PoolExecutor, polled
from robocasa_lerobot.jobs.ray import run_with_ray
from robocasa_lerobot.progress import Bar

FAILED, LOG = "failed.txt", "log.txt"
_LOGS, _REMARK = "slurm", ".remark.txt"


class Piece(Protocol):
    """Work that leaves datasets."""

    @property
    def name(self) -> str:
        """For people, and different from all others."""
        ...

    @property
    def work(self) -> Path:
        """Folder of its own for unfinished files."""
        ...

    @property
    def size(self) -> int:
        """How much there is to do, in the unit of the bar."""
        ...

    def done(self) -> float:
        """How much of `size` has been done."""
        ...

    def make(self, workers: int) -> str:
        """Do it, or the missing part of it; what people should be told of it, or ""."""
        ...


@dataclass(frozen=True)
class Outcome:
    """What came of the pieces.

    Attributes:
        failed: those that could not be made, with their reasons.
        remarks: what people should be told of others.
        submitted: a line instead, where nothing was waited for.
    """

    failed: dict[str, str]
    remarks: dict[str, str] = field(default_factory=dict)
    submitted: str = ""


def run_piece(
    data: Any, rank: int = 0, world_size: int = 1, *, pieces: Sequence[Piece], logs: Path, workers: int
) -> None:
    """Make one of the pieces, in datatrove's calling convention; what it prints goes to its log."""
    piece = pieces[rank]
    piece.work.mkdir(parents=True, exist_ok=True)
    note = piece.work / FAILED
    note.unlink(missing_ok=True)
    with (piece.work / LOG).open("a", encoding="utf-8") as log, contextlib.redirect_stderr(log):
        try:
            remark = piece.make(workers)
        except UserError as error:
            write_text(note, str(error))
            return
    if remark:
        write_text(logs / f"{rank}{_REMARK}", remark)
    shutil.rmtree(piece.work, ignore_errors=True)


def run_pieces(
    pieces: Sequence[Piece],
    folder: Path,
    execution: Execution,
    cores: int,
    what: str,
    unit: str,
    preload: Sequence[str],
) -> Outcome:
    """Run the pieces, each in a process of its own; with fewer pieces than cores one after the other on all of them.

    Args:
        pieces: the ones to make.
        folder: for logs and completion markers; it goes when all is done.
        execution: local, Ray (both wait), or Slurm (submits, and the last job sums up).
        cores: processes of this machine.
        what: title of the bar.
        unit: what the bar counts.
        preload: modules with slow imports.

    Raises:
        UserError: a process died, or the executor is not there or refuses.
    """
    names = "\n".join(piece.name for piece in pieces)
    logs = folder / hashlib.sha256(names.encode()).hexdigest()[:12]
    logs.mkdir(parents=True, exist_ok=True)
    cpus = cores if execution.kind == "local" else execution.cpus
    step = partial(run_piece, pieces=pieces, logs=logs, workers=cpus)
    # Every piece runs: the datasets say what is left, and markers of a run before outlive one that was removed or that
    # is asked for with more demonstrations.
    if execution.kind == "slurm":
        last = partial(_summed_up, pieces, logs)
        array, final = submit_to_slurm(
            step, last, len(pieces), logs, folder / _LOGS, execution.slurm, skip_complete=False
        )
        line = (
            f"submitted to Slurm: {len(pieces)} pieces in job {array}, summed up by job {final}; see {folder / _LOGS}"
        )
        return Outcome({}, submitted=line)
    with _progress(pieces, what, unit):
        if execution.kind == "ray":
            run_with_ray(step, len(pieces), logs, execution.ray, skip_complete=False)
        else:
            _run_here(step, len(pieces), logs, cores, preload)
    return _outcome(pieces, logs)


def _run_here(step: partial[Any], number: int, logs: Path, cores: int, preload: Sequence[str]) -> None:
    if number < cores or cores == 1:
        for rank in range(number):
            step(None, rank)
        return
    PoolExecutor(
        pipeline=[partial(step, workers=1)],
        tasks=number,
        workers=cores,
        skip_completed=False,  # the datasets are the markers
        logging_dir=str(logs),
        preload=list(preload),
    ).run()


def _outcome(pieces: Sequence[Piece], logs: Path) -> Outcome:
    notes = {piece.name: piece.work / FAILED for piece in pieces}
    failed = {name: note.read_text(encoding="utf-8") for name, note in notes.items() if note.is_file()}
    for piece in pieces:
        if piece.name not in failed and piece.done() < piece.size:
            killed = piece.work.is_dir()  # who comes to an end removes it
            failed[piece.name] = (
                f"it ended without a word; see {piece.work / LOG}" if killed else "it has fewer than were asked for"
            )
    said = {rank: logs / f"{rank}{_REMARK}" for rank in range(len(pieces))}
    remarks = {pieces[rank].name: note.read_text(encoding="utf-8") for rank, note in said.items() if note.is_file()}
    shutil.rmtree(logs, ignore_errors=True)
    return Outcome(failed, remarks)


def _summed_up(pieces: Sequence[Piece], logs: Path) -> int:
    """What Slurm's last job prints, and its exit status."""
    outcome = _outcome(pieces, logs)
    for line in outcome_lines(outcome):
        print(line)
    return int(bool(outcome.failed))


def outcome_lines(outcome: Outcome) -> list[str]:
    """For people."""
    if outcome.submitted:
        return [outcome.submitted]
    return [
        *(f"note: {name}: {remark}" for name, remark in outcome.remarks.items()),
        *(f"not made: {name}: {reason}" for name, reason in outcome.failed.items()),
    ]


@contextlib.contextmanager
def _progress(pieces: Sequence[Piece], what: str, unit: str) -> Iterator[None]:
    with Bar(total=sum(piece.size for piece in pieces), unit=unit, desc=what, smoothing=0.05) as bar:
        count = PiecesDone(pieces)

        def show() -> None:
            bar.n = int(count.now())
            bar.refresh()

        with polled(show):
            yield
        bar.n = int(sum(piece.done() for piece in pieces))
        bar.refresh()


class PiecesDone:
    """How much of the pieces is done: those are asked that have a folder for unfinished files, or had one before.

    To ask all of the hundreds of pieces twice a second took a quarter of a core.
    """

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._pieces = {str(piece.work): piece for piece in pieces}
        self._done = {work: piece.done() for work, piece in self._pieces.items()}
        self._begun: set[str] = set()

    def now(self) -> float:
        """The sum."""
        begun = {work for work in self._pieces if os.path.isdir(work)}  # noqa: PTH112 strings are ten times as fast
        for work in begun | self._begun:
            with contextlib.suppress(OSError):
                self._done[work] = self._pieces[work].done()
        self._begun = begun
        return sum(self._done.values())
