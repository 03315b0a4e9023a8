"""What sessions leave: one file for each saved episode, a line for each attempt, one file of all, figures of the work.

Files of single episodes are what counts. The file of all of them is made from them at the end of a session, and at
the start of the next one where a session was killed.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import statistics
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import h5py

from robocasa_lerobot.demos.hdf5 import Failure, merge_parts, read_summary, recorded_otherwise, versions, write_part
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jobs.locks import locked
from robocasa_lerobot.jobs.publish import held_folder
from robocasa_lerobot.teleop.settings import TeleopSettings

STATS_FILE = "teleop-stats.json"
REDO = "redo"  # reason of a discarded attempt whose kitchen comes again
_ATTEMPTS, _SETTINGS, _ASIDE = "attempts.jsonl", "settings.json", ".partial"
_STATS_LOCK = f".{STATS_FILE}.lock"


@dataclass(frozen=True)
class Attempt:
    """How an attempt ended.

    Attributes:
        number: of the kitchen, whose seed is the session's first plus it.
        saved: or discarded.
        reason: why, if discarded.
        steps: recorded.
        undos: of it.
        wall_seconds: from its first input to its end.
        session: when its session began, seconds since 1970.
        at: seconds from then to its end.
    """

    number: int
    saved: bool
    reason: str = ""
    steps: int = 0
    undos: int = 0
    wall_seconds: float = 0.0
    session: float = 0.0
    at: float = 0.0


@dataclass
class Store:
    """The folder of a task's sessions; use it as `with Store(settings).held() as store`."""

    settings: TeleopSettings
    attempts: list[Attempt] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder = self.settings.out / f".{self.settings.task}.teleop"
        self.path = self.settings.out / f"{self.settings.task}.hdf5"
        self._began = time.time()

    @contextlib.contextmanager
    def held(self) -> Iterator[Store]:
        """Keep other sessions out, read what earlier ones left, and merge what a killed one has not.

        Raises:
            UserError: another session holds the folder, there are episodes that were recorded otherwise, or what
                there is cannot be read or merged.
        """
        check_out(self.settings.out)
        with held_folder(self.folder):
            try:
                self._open()
            except OSError as error:
                raise UserError(
                    f"{self.folder} cannot be read, or {self.path.name} not made of it ({error}). Look after the disk, "
                    "then give the same command again."
                ) from error
            yield self

    def _open(self) -> None:
        self._check()
        self._read()
        write_text(self.folder / _SETTINGS, json.dumps(self._recorded_with()))
        merged = read_summary(self.path).episodes if self.path.exists() else 0
        if merged > len(self.saved):
            raise UserError(
                f"{self.path} has {merged} episodes, and {self.folder} the single files of {len(self.saved)}: put "
                "the others back, or choose another --out."
            )
        if merged < len(self.saved):
            self.merge()

    @property
    def saved(self) -> list[int]:
        """Numbers of the kitchens with a saved episode, in the order of the kitchens."""
        return sorted({attempt.number for attempt in self.attempts if attempt.saved})

    @property
    def discarded(self) -> int:
        """How many attempts were discarded, those that were made again included."""
        return sum(not attempt.saved for attempt in self.attempts)

    def next_number(self) -> int:
        """The first kitchen that is neither saved nor discarded for good."""
        ended = {attempt.number for attempt in self.attempts if attempt.saved or attempt.reason != REDO}
        return next(number for number in range(len(ended) + 1) if number not in ended)

    def part(self, number: int) -> Path:
        """The file of a saved episode."""
        return self.folder / f"{number:06d}.hdf5"

    def save(self, number: int, recording: Recording, *, undos: int, wall_seconds: float) -> None:
        """Keep an episode, once: it counts from when its file has its name.

        Raises:
            OSError: it could not be written, or not be noted; save it again, or discard it.
        """
        if number not in self.saved:
            write_part(self.part(number), recording)
            self._note(number, "", len(recording.actions), undos, wall_seconds, saved=True)

    def discard(self, number: int, reason: str, *, steps: int, undos: int, wall_seconds: float) -> None:
        """Note that an attempt came to nothing.

        Raises:
            OSError: that could not be written, and does not count.
        """
        if number not in self.saved:  # its file may be there all the same, where it could not be noted
            self.part(number).unlink(missing_ok=True)
        self._note(number, reason, steps, undos, wall_seconds, saved=False)

    def merge(self) -> Path | None:
        """Write the file of all saved episodes; None where there are none.

        Raises:
            OSError: it could not be written; the one before it is as it was.
        """
        saved = self.saved
        if saved:
            first = self.settings.seed
            merge_parts(
                self.path,
                [self.part(number) for number in saved],
                env_name=self.settings.task,
                env_kwargs=self.settings.env_kwargs(),
                settings=self.settings.identity(),
                tried=len(self.attempts),
                failures=[Failure(first + a.number, a.reason) for a in self.attempts if not a.saved],
            )
        self._write_stats()
        return self.path if saved else None

    def stats(self) -> dict[str, Any]:
        """Figures of the work on this task, over all sessions."""
        kept = [attempt for attempt in self.attempts if attempt.saved]
        sessions: dict[float, float] = {}
        for attempt in self.attempts:
            sessions[attempt.session] = max(sessions.get(attempt.session, 0.0), attempt.at)
        hours = sum(sessions.values()) / 3600
        first = [attempt.at for attempt in kept if attempt.session == min(sessions)]
        reasons = Counter(attempt.reason for attempt in self.attempts if not attempt.saved)
        return {
            "saved": len(kept),
            "discarded": dict(reasons.most_common()),
            "success_share": round(len(kept) / len(self.attempts), 4) if self.attempts else None,
            "hours": round(hours, 4),
            "demonstrations_per_hour": round(len(kept) / hours, 2) if hours else None,
            "seconds_to_first_episode": round(min(first), 1) if first else None,
            "sessions": len(sessions),
            "undos_per_saved": round(sum(a.undos for a in kept) / len(kept), 2) if kept else None,
            "median_steps": statistics.median(a.steps for a in kept) if kept else None,
            "median_wall_seconds": round(statistics.median(a.wall_seconds for a in kept), 1) if kept else None,
        }

    def _note(self, number: int, reason: str, steps: int, undos: int, wall_seconds: float, *, saved: bool) -> None:
        at = time.time() - self._began
        attempt = Attempt(number, saved, reason, steps, undos, round(wall_seconds, 3), self._began, round(at, 3))
        _append(self.folder / _ATTEMPTS, (json.dumps(asdict(attempt)) + "\n").encode())
        self.attempts.append(attempt)
        self._write_stats()

    def _read(self) -> None:
        """Attempts of earlier sessions: the lines that are whole, and episodes that were saved just before a kill."""
        file = self.folder / _ATTEMPTS
        lines = file.read_text(encoding="utf-8").split("\n") if file.exists() else [""]
        self.attempts = [Attempt(**json.loads(line)) for line in lines[:-1]]
        if lines[-1]:  # cut off by a kill; what follows would be added to it
            write_text(file, "".join(line + "\n" for line in lines[:-1]))
        known = set(self.saved)
        for left in self.folder.glob(f"*{_ASIDE}"):
            left.unlink()
        for part in sorted(self.folder.glob("[0-9]*.hdf5")):
            if int(part.stem) not in known:
                with h5py.File(part) as opened:
                    steps = int(opened["demo"].attrs["num_samples"])
                self._note(int(part.stem), "", steps, 0, 0.0, saved=True)
        gone = [number for number in self.saved if not self.part(number).exists()]
        if gone:
            raise UserError(
                f"{self.folder} lacks the files of {len(gone)} saved episodes ({self.part(gone[0]).name}, ...): "
                "put them back, or choose another --out."
            )

    def _recorded_with(self) -> dict[str, Any]:
        """What episodes of one file have in common: under other versions the same seed may be another kitchen."""
        return {**self.settings.identity(), **versions()}

    def _check(self) -> None:
        note = self.folder / _SETTINGS
        own = self._recorded_with()
        before = json.loads(note.read_text(encoding="utf-8")) if note.exists() else own
        if before != own:
            if self.path.exists() or any(self.folder.glob("[0-9]*.hdf5")):
                others = recorded_otherwise(before, self.settings.identity(), versions())
                raise UserError(
                    f"{self.settings.out} has episodes of {self.settings.task} that were recorded with {others} them, "
                    "or choose another --out."
                )
            note.unlink()  # nothing was kept with other settings, and numbers of attempts stand for other kitchens
            (self.folder / _ATTEMPTS).unlink(missing_ok=True)
        if self.path.exists() and (not note.exists() or not self._is_ours()):
            raise UserError(
                f"{self.path} exists, and this command did not record it here. Move it away, or choose another --out."
            )

    def _is_ours(self) -> bool:
        """Whether the file of all episodes is one that a session with these settings wrote."""
        try:
            return read_summary(self.path).settings == self.settings.identity()
        except (OSError, KeyError, ValueError):
            return False

    def _write_stats(self) -> None:
        """Write the figures, where that is possible: they follow from the attempts, and come again with the next."""
        file, own = self.settings.out / STATS_FILE, self.stats()
        # Sessions of several tasks may share the folder: none may read the file before another has written it.
        with contextlib.suppress(OSError), locked(self.settings.out / _STATS_LOCK, wait=True):
            try:
                known: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
            except ValueError:
                known = {}
            write_text(file, json.dumps({**known, self.settings.task: own}, indent=1) + "\n")


def check_out(out: Path) -> None:
    """Whether the folder of the sessions is there or can be made; nothing is made.

    Raises:
        UserError: there is a file in its place, or nothing may be written.
    """
    there = next(path for path in (out, *out.absolute().parents) if _exists(path))
    if not there.is_dir():
        raise UserError(f"--out {out}: {there} is a file. Choose a folder.")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UserError(f"--out {out}: nothing may be written in {there}. Choose another folder, or change its rights.")


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except PermissionError:  # of a folder above it, which is asked next
        return False


def _append(file: Path, line: bytes) -> None:
    """Add a line to a file, all of it or nothing.

    Raises:
        OSError: nothing was added.
    """
    with file.open("ab", buffering=0) as opened:
        before = opened.tell()
        try:
            if opened.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))
            os.fsync(opened.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                opened.truncate(before)
            raise
