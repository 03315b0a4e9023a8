"""Measures of a task's demonstrations together: which starts they cover, how they differ, how sources are used."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.distance import pdist

from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.hdf5 import Failure, read_summary
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.quality.measure import Measures, Start, measure, start_of
from robocasa_lerobot.demos.replay import demonstrations
from robocasa_lerobot.errors import OF_THE_MACHINE
from robocasa_lerobot.jobs.as_completed import as_they_end

BIN_M = 0.2  # sides of the squares of the floor that starts are counted in

type Square = tuple[int, int]


@dataclass(frozen=True)
class Quality:
    """Of the demonstrations of a task.

    Attributes:
        task: name.
        kept: measures of those that were kept.
        failed: starts of the attempts that were not.
        in_vain: segments that each attempt that was not kept had begun, where they were generated.
        nowhere: attempts that were not kept and have no start, since their kitchen cannot be made.
    """

    task: str
    kept: tuple[Measures, ...]
    failed: tuple[Start, ...]
    in_vain: tuple[tuple[tuple[str, str], ...], ...] = ()
    nowhere: int = 0

    @property
    def tried(self) -> int:
        """Attempts."""
        return len(self.kept) + len(self.failed) + self.nowhere

    @property
    def rate(self) -> float:
        """Of attempts, that were kept."""
        return len(self.kept) / max(self.tried, 1)

    @property
    def covered(self) -> float:
        """Share of the squares in which an attempt began, in which one began that was kept."""
        return covered_share(map(square_of, (one.start for one in self.kept)), map(square_of, self.failed))

    @property
    def most_used_source(self) -> float | None:
        """Share of all segments that come from the source that most come from; None where none was generated."""
        return max(self._used.values()) / self._used.total() if self._used else None

    @property
    def effective_sources(self) -> float | None:
        """Of how many evenly used sources the segments would be as mixed: one over the sum of squared shares."""
        squares = sum(count**2 for count in self._used.values())
        return self._used.total() ** 2 / squares if self._used else None

    def kept_with(self, which: int) -> dict[str, tuple[int, int]]:
        """Of the attempts that began a segment, how many were kept and how many there were.

        Args:
            which: 0 tells segments apart by what they are about, 1 by their source.
        """
        kept = Counter(name for one in self.kept for name in {segment[which] for segment in one.segments})
        lost = Counter(name for segments in self.in_vain for name in {segment[which] for segment in segments})
        return {name: (kept[name], kept[name] + lost[name]) for name in sorted({*kept, *lost})}

    @property
    def path_spread_m(self) -> float:
        """Root mean square distance of two demonstrations' hands, at the same share of their time."""
        return float(np.mean(self._path_distances)) if len(self.kept) > 1 else 0.0

    @property
    def most_alike_m(self) -> float:
        """The same of the two that are most alike."""
        return float(np.min(self._path_distances)) if len(self.kept) > 1 else 0.0

    @property
    def stand_spread_m(self) -> float:
        """Standard deviation of where the base stands at the end, before what the first stage is about."""
        return float(np.hypot(*np.std([one.stand[:2] for one in self.kept], axis=0))) if self.kept else 0.0

    @property
    def stand_spread_rad(self) -> float:
        """The same of its heading, relative to that at the beginning, on the circle."""
        if not self.kept:
            return 0.0
        turns = np.exp(1j * np.array([one.stand[2] for one in self.kept]))
        return float(np.sqrt(-2.0 * np.log(np.clip(np.abs(turns.mean()), 1e-12, 1.0))))

    def mean(self, name: str) -> float:
        """Of a measure."""
        return float(np.mean([getattr(one, name) for one in self.kept])) if self.kept else 0.0

    @property
    def seconds_spread(self) -> float:
        """Standard deviation of how long they take."""
        return float(np.std([one.seconds for one in self.kept])) if self.kept else 0.0

    def as_json(self) -> dict[str, Any]:
        """All of it in plain values."""
        names = (
            *("rate", "covered", "most_used_source", "effective_sources"),
            *("path_spread_m", "most_alike_m", "stand_spread_m"),
        )
        means = ("seconds", "jerk", "idle", "saturated", "other_contacts", "in_view")
        own = {name: getattr(self, name) for name in (*names, "stand_spread_rad", "seconds_spread")}
        rates = {"segments": self.kept_with(0), "sources": self.kept_with(1)}
        return {"task": self.task, "kept": len(self.kept), **own, **{name: self.mean(name) for name in means}, **rates}

    @cached_property
    def _used(self) -> Counter[int]:
        """How many segments come from each source."""
        return Counter(source for one in self.kept for source in one.sources)

    @cached_property
    def _path_distances(self) -> Array:
        """(n (n - 1) / 2,) of all pairs, metres."""
        paths = np.array([one.path for one in self.kept])
        found: Array = pdist(paths.reshape(len(paths), -1)) / np.sqrt(paths.shape[1])
        return found


def covered_share(kept: Iterable[Square], failed: Iterable[Square]) -> float:
    """Share of the squares in which attempts began, in which one began that was kept."""
    own = set(kept)
    return len(own) / max(len(own.union(failed)), 1)


def square_of(start: Start) -> Square:
    """Of the floor, in which an episode begins: numbers from the object or fixture on, ahead and to the left."""
    return int(np.floor(start.ahead_m / BIN_M)), int(np.floor(start.left_m / BIN_M))


@dataclass(frozen=True)
class Part:
    """What came of looking at one attempt of a file.

    Attributes:
        path: the file.
        kept: measures of one that was kept.
        failed: start of one that was not; None where its kitchen cannot be made.
        in_vain: segments that it had begun.
    """

    path: Path
    kept: Measures | None = None
    failed: Start | None = None
    in_vain: tuple[tuple[str, str], ...] = ()


def attempts_in(paths: Sequence[Path]) -> list[tuple[Path, str | Failure]]:
    """All attempts of files or folders: the names of those that were kept, and those that failed.

    Raises:
        UserError: there are no demonstrations.
    """
    kept = demonstrations(paths)
    found: list[tuple[Path, str | Failure]] = list(kept)
    for path in dict.fromkeys(path for path, _ in kept):
        found += [(path, failure) for failure in read_summary(path).failures]
    return found


def look_at(attempts: Sequence[tuple[Path, str | Failure]], workers: int = 1) -> Iterator[Part]:
    """Look at attempts, as they end."""
    yield from as_they_end(_look, attempts, workers)


def _look(path: Path, which: str | Failure) -> Part:
    if isinstance(which, str):
        return Part(path, kept=measure(path, which))
    settings = read_summary(path).settings or {}
    env = RecordingSettings(
        settings.get("task", path.stem),
        episodes=1,
        split=settings.get("split", "target"),
        layouts=settings.get("layouts"),
        styles=settings.get("styles"),
        start_within_m=float(settings.get("start_within_m", 0.0)),
    ).make_env()
    with contextlib.closing(env):
        try:
            env.reset(seed=which.scene_seed)
        except OF_THE_MACHINE:
            raise
        except Exception:  # no more than when it was recorded, which is why the attempt failed
            return Part(path, in_vain=which.segments)
        return Part(path, failed=start_of(env), in_vain=which.segments)


def qualities(parts: Iterable[Part]) -> list[Quality]:
    """What was looked at, task by task."""
    found: dict[str, list[Part]] = {}
    for part in parts:
        found.setdefault(part.path.stem, []).append(part)
    return [_quality(task, looked_at) for task, looked_at in sorted(found.items())]


def _quality(task: str, parts: Sequence[Part]) -> Quality:
    kept = [part.kept for part in parts if part.kept is not None]
    lost = [part for part in parts if part.kept is None]
    failed = tuple(part.failed for part in lost if part.failed is not None)
    in_vain = tuple(part.in_vain for part in lost)
    return Quality(
        task,
        tuple(sorted(kept, key=lambda one: one.start.seed)),
        failed,
        in_vain,
        nowhere=len(lost) - len(failed),
    )
