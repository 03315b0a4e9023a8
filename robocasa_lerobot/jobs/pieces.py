"""The pieces of a long work on this machine, on Ray or on Slurm, with completion markers and one bar over all."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import Execution, submit_to_slurm
from robocasa_lerobot.jobs.pool import PoolExecutor, exit_if_orphaned, polled
from robocasa_lerobot.jobs.ray import run_with_ray
from robocasa_lerobot.progress import Bar

_EXECUTOR = "executor"  # folder of completion markers
_PROGRESS, _TOTAL = "progress", "total"
Step = Callable[..., None]


def run_pieces(
    step: Step,
    pieces: int,
    partial: Path,
    execution: Execution,
    workers: int,
    num_frames: int,
    what: str,
    initializer: Callable[[], None],
    preload: Sequence[str],
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
        preload: modules with slow imports.
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
        preload=preload,
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


def report_frames(partial: Path, rank: int, count: int) -> None:
    """Leave a piece's count of frames where the bar finds it; ends a worker whose parent was killed."""
    exit_if_orphaned()
    with contextlib.suppress(OSError):  # only for the eye
        file = partial / _PROGRESS / f"{rank:05d}"
        file.parent.mkdir(exist_ok=True)
        file.write_text(str(count))


def share_done(partial: Path) -> float:
    """The share of a work's frames that is done, 0 where nothing tells; asked from outside while it runs."""
    folder = partial / _PROGRESS
    with contextlib.suppress(OSError, ValueError):
        total = int((folder / _TOTAL).read_text())
        counts = (_count(path) for path in folder.iterdir() if path.name != _TOTAL)
        return min(1.0, sum(counts) / total) if total else 0.0
    return 0.0


def _count(path: Path) -> int:
    """What a piece has reported."""
    with contextlib.suppress(OSError, ValueError):
        return int(path.read_text())
    return 0


@contextlib.contextmanager
def _progress_bar(pieces: int, partial: Path, num_frames: int, what: str) -> Iterator[None]:
    """A bar over frames, fed by the counts that the workers leave in files."""
    folder = partial / _PROGRESS
    with contextlib.suppress(OSError):  # only for the eye
        folder.mkdir(exist_ok=True)
        (folder / _TOTAL).write_text(str(num_frames))

    def show() -> None:
        bar.n = min(num_frames, sum(_count(folder / f"{rank:05d}") for rank in range(pieces)))
        bar.refresh()

    with Bar(total=num_frames, unit="frame", desc=what, smoothing=0.05) as bar:
        with polled(show):
            yield
        bar.n = num_frames
