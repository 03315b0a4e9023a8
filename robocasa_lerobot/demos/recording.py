"""Recording: attempts at demonstrations of tasks, spread over processes, until enough of each have succeeded."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from robocasa_lerobot.demos.attempts import Parts, RecordingSettings, Tally
from robocasa_lerobot.demos.failures import remove_others
from robocasa_lerobot.demos.hdf5 import RECORDED, Failure, merge_parts, read_summary
from robocasa_lerobot.demos.progress import Board
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError, differing
from robocasa_lerobot.gl import ensure_drawing
from robocasa_lerobot.jobs.pool import PoolExecutor, polled
from robocasa_lerobot.jobs.publish import held_lock
from robocasa_lerobot.jobs.workers import check_workers

__all__ = ["FAILURES_FOLDER", "RecordingResult", "RecordingSettings", "record_task", "record_tasks"]

FAILURES_FOLDER = "failures"
# Attempts of a process in one round: files appear after each, and starting processes takes two seconds.
_ROUND = 24


@dataclass(frozen=True)
class RecordingResult:
    """What came of it.

    Attributes:
        path: of the file, which is not there if the task was given up.
        episodes, steps: in it.
        tried: attempts that it took.
        failures: those of them that failed.
        gave_up: why the task was given up, or "".
    """

    path: Path
    episodes: int
    steps: int
    tried: int
    failures: list[Failure]
    gave_up: str = ""

    @property
    def task(self) -> str:
        """Name."""
        return self.path.stem


def record_task(
    settings: RecordingSettings,
    out: Path,
    *,
    workers: int = 1,
    keep_failures: bool = False,
    show_progress: bool = True,
) -> RecordingResult:
    """Record demonstrations of a task to `out/<task>.hdf5`.

    Raises:
        UserError: what `record_tasks` raises, or too many attempts failed.
    """
    result = record_tasks([settings], out, workers=workers, keep_failures=keep_failures, show_progress=show_progress)[0]
    if result.gave_up:
        raise UserError(result.gave_up)
    return result


def record_tasks(
    all_settings: Sequence[RecordingSettings],
    out: Path,
    *,
    workers: int = 1,
    keep_failures: bool = False,
    show_progress: bool = True,
) -> list[RecordingResult]:
    """Record demonstrations of several tasks, each to `out/<task>.hdf5`; a task that cannot be solved ends no other.

    A task whose file is there is left alone; one that was interrupted goes on.

    Args:
        all_settings: of the tasks, each once.
        out: folder.
        workers: processes.
        keep_failures: write a film and a description of each failed attempt to `out/failures/<task>/`.
        show_progress: on the terminal.

    Raises:
        UnknownNameError: no such task, split, layout or style.
        UserError: a file, or what an interrupted recording left, has other settings or is of other versions, the same
            recording is running already, episodes or workers are below 1, or a seed is below 0.
    """
    for settings in all_settings:
        settings.check()  # before any process starts
    check_workers(workers)
    if keep_failures or any(settings.images for settings in all_settings):
        ensure_drawing()
    results: dict[str, RecordingResult] = {}
    waiting: list[Parts] = []
    for settings in all_settings:
        if _file(out, settings).exists():
            results[settings.task] = _recorded(_file(out, settings), settings)
            _clear_away(Parts(out, settings))
        else:
            waiting.append(Parts(out, settings, out / FAILURES_FOLDER / settings.task if keep_failures else None))
    with contextlib.ExitStack() as stack:
        for parts in waiting:
            stack.enter_context(held_lock(_lock(parts)))
            parts.prepare()
        board = stack.enter_context(Board([parts.settings for parts in waiting], show=show_progress))
        for result in _record(waiting, out, workers, board):
            results[result.task] = result
    return [results[settings.task] for settings in all_settings]


def _record(waiting: list[Parts], out: Path, workers: int, board: Board) -> Iterator[RecordingResult]:
    """Rounds of attempts at the tasks in their order; the result of each task when it is complete."""
    left = list(waiting)
    most = _ROUND * workers if workers > 1 else 1
    while left:
        jobs: list[tuple[Parts, int]] = []
        for parts in list(left):
            tally = parts.tally()
            board.update(parts.settings, tally)
            result = _finished(parts, tally, out)
            if result is not None:
                left.remove(parts)
                board.finish(parts.settings, tally)
                yield result
                continue
            wanted = parts.wanted(tally)
            if len(left) == 1:  # nothing else to do for a process that would wait
                beyond = range(max(wanted) + 1, parts.most(tally))
                wanted += list(beyond)[: -len(wanted) % workers]
            jobs += [(parts, number) for number in wanted]
            if len(jobs) >= most:
                break
        if jobs:
            _run_round(jobs[:most], workers, board)


def _finished(parts: Parts, tally: Tally, out: Path) -> RecordingResult | None:
    """The result of a task that is complete, whose file is written, or given up; else None."""
    settings, path = parts.settings, _file(out, parts.settings)
    gave_up = parts.gave_up(tally)
    if gave_up:
        return RecordingResult(path, 0, 0, tally.tried, tally.failures, gave_up)
    if len(tally.chosen) < settings.episodes:
        return None
    if parts.films is not None:  # before the file appears, after which nobody would look for them
        remove_others(parts.films, tally.failures)
    steps = merge_parts(
        path,
        [parts.episode(number) for number in tally.chosen],
        env_name=settings.task,
        env_kwargs=settings.env_kwargs(),
        settings={**settings.identity(), "episodes": settings.episodes},
        tried=tally.tried,
        failures=tally.failures,
    )
    shutil.rmtree(parts.folder)
    return RecordingResult(path, len(tally.chosen), steps, tally.tried, tally.failures)


def _clear_away(parts: Parts) -> None:
    """Remove what a run left that was killed after the task's file had appeared."""
    lock = _lock(parts)
    if lock.exists() or parts.folder.exists():
        with contextlib.suppress(UserError), held_lock(lock):  # held by another run, which is about to do it
            shutil.rmtree(parts.folder, ignore_errors=True)


def _lock(parts: Parts) -> Path:
    return parts.folder.with_suffix(".lock")


def _file(out: Path, settings: RecordingSettings) -> Path:
    return out / f"{settings.task}.hdf5"


def _recorded(path: Path, settings: RecordingSettings) -> RecordingResult:
    """The result that a finished file holds, if it was recorded with these settings.

    Raises:
        UserError: it was recorded with others.
    """
    summary = read_summary(path)
    others = differing(summary.settings or {}, {**RECORDED, **settings.identity(), "episodes": settings.episodes})
    if others:
        raise UserError(
            f"{path} exists and was recorded with other settings ({others}). Remove it, or choose another --out."
        )
    return RecordingResult(path, summary.episodes, summary.steps, summary.tried, summary.failures)


def _run_round(jobs: list[tuple[Parts, int]], workers: int, board: Board) -> None:
    if workers == 1:
        for job in jobs:
            _attempt([job], 0)
            board.update(job[0].settings, job[0].tally())
        return
    tasks = list(dict.fromkeys(parts for parts, _ in jobs))

    def show() -> None:
        for parts in tasks:
            board.update(parts.settings, parts.tally())

    executor = PoolExecutor(
        pipeline=[partial(_rank_attempt, jobs=jobs)],
        tasks=len(jobs),
        workers=min(workers, len(jobs)),
        # Outcomes are the markers; datatrove's own would outlive a removed part.
        skip_completed=False,
        logging_dir=str(tasks[0].folder / "logs"),
        preload=[KitchenEnv.__module__],
    )
    with polled(show):
        executor.run()


def _rank_attempt(data: Any, rank: int = 0, world_size: int = 1, *, jobs: list[tuple[Parts, int]]) -> None:
    """One attempt, in datatrove's calling convention."""
    _attempt(jobs, rank)


def _attempt(jobs: list[tuple[Parts, int]], index: int) -> None:
    parts, number = jobs[index]
    env = parts.settings.make_env()
    try:
        parts.attempt(number, env)
    finally:
        env.close()
