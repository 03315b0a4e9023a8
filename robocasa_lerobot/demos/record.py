"""Recording: attempts at demonstrations, spread over processes, until enough have succeeded.

Attempt i of a task uses seed `seed + i`, and the file holds the first successes in this order, so that the result is
the same for any number of workers and after any interruption. Every attempt leaves a small file in a folder beside
the output, which is how a killed recording goes on where it was.
"""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from robocasa_lerobot.demos.episode import record_episode
from robocasa_lerobot.demos.hdf5 import Failure, merge_parts, read_summary, write_part
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.registry import get_task
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.gl import ensure_gl
from robocasa_lerobot.parallel import PoolExecutor, exit_if_orphaned, polled

# Give up when this many attempts per wanted episode were not enough.
MAX_ATTEMPTS_PER_EPISODE = 10


@dataclass(frozen=True)
class RecordingSettings:
    """What a file of demonstrations is made from.

    Attributes:
        task: name.
        episodes: successes wanted.
        split: of the kitchens.
        seed: of the first attempt.
        action_noise: see `record_episode`.
        images: whether camera pictures are stored.
        image_size: of those pictures, pixels.
    """

    task: str
    episodes: int
    split: str = "target"
    seed: int = 0
    action_noise: float = 0.05
    images: bool = False
    image_size: int = 256

    def env_kwargs(self) -> dict[str, Any]:
        """Arguments of the env, for the file's `env_args`."""
        return {"split": self.split, "image_size": self.image_size, "render_preset": "fast"}

    def identity(self) -> dict[str, Any]:
        """What attempts depend on: parts recorded under other values are not reused. `episodes` is not among it."""
        return {key: getattr(self, key) for key in ("task", "split", "seed", "action_noise", "images", "image_size")}


@dataclass(frozen=True)
class RecordingResult:
    """What came of it: the file, episodes, steps, attempts and failures."""

    path: Path
    episodes: int
    steps: int
    tried: int
    failures: list[Failure]


def record_task(
    settings: RecordingSettings, out: Path, *, workers: int = 1, show_progress: bool = True
) -> RecordingResult:
    """Record demonstrations of a task to `out/<task>.hdf5`.

    Raises:
        UnknownNameError: no such task or split.
        UserError: the file exists, episodes or workers below 1, or too many attempts failed.
    """
    get_task(settings.task)
    KitchenEnv(settings.task, split=settings.split)  # checks the names before any process starts
    if settings.episodes < 1 or workers < 1:
        raise UserError(f"episodes ({settings.episodes}) and workers ({workers}) must be at least 1.")
    path = out / f"{settings.task}.hdf5"
    if path.exists():
        return _recorded(path, settings)
    if settings.images:
        ensure_gl()
    parts = out / f".{settings.task}.parts"
    _prepare(parts, settings)
    seen = -1
    with tqdm(total=settings.episodes, desc=settings.task, unit="episode", disable=not show_progress) as bar:
        while True:
            done = _outcomes(parts)
            chosen, tried, failures = _first_successes(done, settings)
            if len(chosen) == settings.episodes:
                break
            assert len(done) > seen, "a round of attempts left no outcome"
            seen = len(done)
            limit = settings.episodes * MAX_ATTEMPTS_PER_EPISODE
            if tried >= limit:
                last = failures[-1].reason if failures else ""
                raise UserError(
                    f"{settings.task}: {len(chosen)} of {settings.episodes} episodes succeeded in {tried} attempts "
                    f"(last failure: {last}). Ask for fewer episodes, less --action-noise, or another --seed."
                )
            missing = settings.episodes - len(chosen)
            wanted = [i for i in range(limit) if i not in done][: max(missing, math.ceil(missing / workers) * workers)]
            _run_round(settings, parts, wanted, workers, bar)
        bar.n = settings.episodes
        bar.refresh()
    steps = merge_parts(
        path,
        [parts / f"{i:06d}.hdf5" for i in chosen],
        env_name=settings.task,
        env_kwargs=settings.env_kwargs(),
        settings={**settings.identity(), "episodes": settings.episodes},
        tried=tried,
        failures=failures,
    )
    shutil.rmtree(parts)
    return RecordingResult(path, len(chosen), steps, tried, failures)


def _recorded(path: Path, settings: RecordingSettings) -> RecordingResult:
    """The result that a finished file holds, if it was recorded with these settings.

    Raises:
        UserError: it was recorded with others.
    """
    summary = read_summary(path)
    wanted = {**settings.identity(), "episodes": settings.episodes}
    if summary.settings != wanted:
        found = summary.settings or {}
        differing = ", ".join(f"{k}: {found.get(k)!r}, now {v!r}" for k, v in wanted.items() if found.get(k) != v)
        raise UserError(
            f"{path} exists and was recorded with other settings ({differing}). Remove it, or choose another --out."
        )
    return RecordingResult(path, summary.episodes, summary.steps, summary.tried, summary.failures)


def _prepare(parts: Path, settings: RecordingSettings) -> None:
    """Make the folder of parts, dropping one that was recorded with other settings."""
    note = parts / "settings.json"
    if parts.exists() and (not note.exists() or json.loads(note.read_text()) != settings.identity()):
        shutil.rmtree(parts)
    parts.mkdir(parents=True, exist_ok=True)
    note.write_text(json.dumps(settings.identity()))


def _outcomes(parts: Path) -> dict[int, str | None]:
    """Attempt -> None if it succeeded, else why not."""
    done: dict[int, str | None] = {int(f.stem): None for f in parts.glob("[0-9]*.hdf5")}
    done |= {int(f.stem): json.loads(f.read_text())["reason"] for f in parts.glob("[0-9]*.json")}
    return done


def _first_successes(done: dict[int, str | None], settings: RecordingSettings) -> tuple[list[int], int, list[Failure]]:
    """The first successes among attempts 0, 1, 2, ... without a gap; how many attempts that took; those that failed."""
    chosen: list[int] = []
    failures: list[Failure] = []
    attempt = 0
    while attempt in done and len(chosen) < settings.episodes:
        reason = done[attempt]
        if reason is None:
            chosen.append(attempt)
        else:
            failures.append(Failure(settings.seed + attempt, reason))
        attempt += 1
    return chosen, attempt, failures


def _run_round(settings: RecordingSettings, parts: Path, attempts: list[int], workers: int, bar: tqdm[Any]) -> None:
    if workers == 1:
        _attempt_all(settings, parts, attempts, on_done=lambda: _show(bar, parts))
        return
    tasks = min(workers, len(attempts))
    executor = PoolExecutor(
        pipeline=[partial(_rank_attempts, settings=settings, parts=parts, attempts=attempts)],
        tasks=tasks,
        workers=tasks,
        # Outcomes in `parts` are the markers; datatrove's own would outlive a removed part.
        skip_completed=False,
        logging_dir=str(parts / "logs"),
        preload=[KitchenEnv.__module__],
    )
    with polled(lambda: _show(bar, parts)):
        executor.run()


def _rank_attempts(
    data: Any, rank: int = 0, world_size: int = 1, *, settings: RecordingSettings, parts: Path, attempts: list[int]
) -> None:
    """One process's share of a round, in datatrove's calling convention."""
    _attempt_all(settings, parts, attempts[rank::world_size])


def _attempt_all(settings: RecordingSettings, parts: Path, attempts: list[int], on_done: Any = None) -> None:
    env = KitchenEnv(settings.task, split=settings.split, image_size=settings.image_size, terminate_on_success=False)
    try:
        for attempt in attempts:
            exit_if_orphaned()
            recording = record_episode(
                env, settings.seed + attempt, action_noise=settings.action_noise, images=settings.images
            )
            if recording.success:
                write_part(parts / f"{attempt:06d}.hdf5", recording)
            else:
                note = parts / f"{attempt:06d}.json"
                aside = note.with_suffix(".partial")
                aside.write_text(json.dumps({"seed": recording.seed, "reason": recording.reason}))
                aside.replace(note)
            if on_done is not None:
                on_done()
    finally:
        env.close()


def _show(bar: tqdm[Any], parts: Path) -> None:
    done = _outcomes(parts)
    failed = sum(reason is not None for reason in done.values())
    bar.n = min(len(done) - failed, int(bar.total or 0))
    bar.set_postfix(failed=failed)
