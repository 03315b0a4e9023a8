"""Long work in pieces, whose result appears at once: a folder beside the output, a lock, an executor, one rename."""

from __future__ import annotations

import contextlib
import fcntl
import os
import platform
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from robocasa_lerobot.convert.running.executors import Execution, run_with_ray, submit_to_slurm
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.parallel import PoolExecutor, exit_if_orphaned, polled
from robocasa_lerobot.progress import Bar

_EXECUTOR = "executor"  # folder of completion markers
Step = Callable[..., None]


def check_output(out: Path, overwrite: bool) -> None:
    """Whether a dataset may appear at `out`.

    Raises:
        UserError: there is something.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not overwrite:
        raise UserError(f"{out} exists already. Choose another --out, or replace it with --overwrite.")
    if not (out / "meta" / "info.json").is_file():
        raise UserError(f"{out} is not a LeRobotDataset, so --overwrite leaves it alone. Choose another --out.")


def partial_folder(out: Path, fingerprint: str) -> Path:
    """Where the work is done: named by what decides its bytes, so that the same command finds it again."""
    return out.with_name(f"{out.name}.partial-{fingerprint}")


@contextlib.contextmanager
def locked(partial: Path) -> Iterator[None]:
    """Make the folder and keep others out of it.

    Raises:
        UserError: the same work is running already, or the folder cannot be made.
    """
    try:
        partial.mkdir(parents=True, exist_ok=True)
        file = (partial / "lock").open("w")
    except OSError as error:
        raise UserError(f"nothing can be written beside the output: {error}. Choose another --out.") from None
    with file as lock:
        try:
            # A record lock is not inherited, so no orphaned child holds it after the parent was killed.
            fcntl.lockf(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UserError(f"the same work is running already (it holds {partial}). Wait until it ends.") from None
        yield


@contextlib.contextmanager
def failures_explained(out: Path, partial: Path) -> Iterator[None]:
    """Turn errors of the file system, such as a full disk, into ones that say what is kept and what to do."""
    try:
        yield
    except OSError as error:
        raise UserError(
            f"writing failed: {error}. Nothing is at {out}; finished parts are kept in {partial}: free what is "
            "lacking and give the same command to go on."
        ) from error


def publish(merged: Path, out: Path, replaced: Path) -> None:
    """Let the finished dataset appear at `out` by a rename, after moving an old one aside."""
    if out.exists():
        shutil.rmtree(replaced, ignore_errors=True)
        out.rename(replaced)
    merged.rename(out)


def run_pieces(
    step: Step,
    pieces: int,
    partial: Path,
    execution: Execution,
    workers: int,
    num_frames: int,
    what: str,
    initializer: Callable[[], None],
    preload: str,
) -> None:
    """Run the pieces that are not complete, with a bar over frames, and wait for them.

    Args:
        step: datatrove's step for one piece; it calls `report_frames`.
        pieces: their number.
        partial: the folder of the work.
        execution: local or Ray.
        workers: processes on this machine.
        num_frames: in all pieces.
        what: title of the bar.
        initializer: called in each process.
        preload: module with slow imports.
    """
    assert execution.kind != "slurm", "jobs are submitted, not waited for"
    initializer()
    folder = partial / _EXECUTOR
    if execution.kind == "ray":
        with _progress_bar(pieces, partial, num_frames, what):
            run_with_ray(step, pieces, folder, execution.ray)
        return
    executor = PoolExecutor(
        pipeline=[step],
        tasks=pieces,
        workers=workers,
        logging_dir=str(folder),
        initializer=initializer,
        preload=[preload],
    )
    if executor.get_incomplete_ranks():
        with _progress_bar(pieces, partial, num_frames, what):
            executor.run()


def submit_pieces(
    step: Step, finish: Callable[[], object], pieces: int, partial: Path, out: Path, execution: Execution
) -> str:
    """Submit the pieces that are not complete to Slurm, and `finish` after them; gives a line for the user."""
    logs = out.with_name(f"{out.name}.slurm")  # not inside: a job cannot remove the file it prints to
    array, last = submit_to_slurm(step, finish, pieces, partial / _EXECUTOR, logs, execution.slurm)
    first = f"pieces in job {array}, " if array else "all pieces are complete; "
    return f"submitted to Slurm: {first}joined by job {last}. What they print is in {logs}. {out} appears at the end."


def require_complete(pieces: int, partial: Path) -> None:
    """Check that every piece has its completion marker.

    Raises:
        UserError: some are missing.
    """
    folder = partial / _EXECUTOR / "completions"
    done = {path.name for path in folder.glob("*")}
    missing = [rank for rank in range(pieces) if f"{rank:05d}" not in done]
    if missing:
        raise UserError(
            f"{len(missing)} of {pieces} pieces are not complete (the first: {missing[0]}): there is nothing to join "
            "yet. Give the same command without --merge to run them."
        )


def make_piece(folder: Path, make: Callable[[Path], object]) -> None:
    """Let `make` fill a folder that then gets its name; nothing is done where it is there already.

    Each process fills one of its own, since the worker of a run that was killed may still be at the same piece for a
    moment. Whoever is first wins: the bytes are the same.
    """
    if folder.exists():
        return  # complete; only the executor's marker was lost
    attempt = folder.with_name(f"{folder.name}.attempt-{platform.node()}-{os.getpid()}")
    shutil.rmtree(attempt, ignore_errors=True)
    attempt.mkdir(parents=True)
    make(attempt)
    try:
        attempt.rename(folder)
    except OSError:
        if not folder.exists():
            raise
        shutil.rmtree(attempt)


def report_frames(partial: Path, rank: int, count: int) -> None:
    """Leave a piece's count of frames where the bar finds it; ends a worker whose parent was killed."""
    exit_if_orphaned()
    with contextlib.suppress(OSError):  # only for the eye
        file = partial / "progress" / f"{rank:05d}"
        file.parent.mkdir(exist_ok=True)
        file.write_text(str(count))


@contextlib.contextmanager
def _progress_bar(pieces: int, partial: Path, num_frames: int, what: str) -> Iterator[None]:
    """A bar over frames, fed by the counts that the workers leave in files."""

    def done(rank: int) -> int:
        with contextlib.suppress(OSError, ValueError):
            return int((partial / "progress" / f"{rank:05d}").read_text())
        return 0

    def show() -> None:
        bar.n = min(num_frames, sum(done(rank) for rank in range(pieces)))
        bar.refresh()

    with Bar(total=num_frames, unit="frame", desc=what, smoothing=0.05) as bar:
        with polled(show):
            yield
        bar.n = num_frames
