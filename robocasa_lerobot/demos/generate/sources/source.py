"""Prepared demonstrations as sources: read once a process, and asked for the segments that fit a stage."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np

from robocasa_lerobot.demos.generate.sources.frames import JOINTED
from robocasa_lerobot.demos.generate.sources.prepared import GROUP, VERSION, Prepared, is_prepared, read_prepared
from robocasa_lerobot.demos.generate.sources.rules import CutRules, rules_from
from robocasa_lerobot.demos.generate.sources.segments import PART, USE, Segment, cut
from robocasa_lerobot.demos.generate.sources.uses import UNDER_WATER
from robocasa_lerobot.demos.replay import demonstrations
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.hdf5_files import hdf5_files_of

type Stamp = tuple[tuple[str, int, int], ...]


class UnfitSourcesError(UserError):
    """Nothing can be generated from these sources, however often it is tried; from others it might."""


@dataclass(frozen=True, eq=False)
class Source:
    """A prepared demonstration.

    Attributes:
        number: among the sources.
        name: file and demonstration.
        task: that it solves.
        seed: of its scene.
        data: what preparing found.
        segments: its pieces.
        rules: by which it was cut.
    """

    number: int
    name: str
    task: str
    seed: int
    data: Prepared
    segments: tuple[Segment, ...]
    rules: Mapping[str, CutRules]


@dataclass(frozen=True, eq=False)
class Piece:
    """A segment of a source."""

    source: Source
    segment: Segment

    @property
    def data(self) -> Prepared:
        """Of its demonstration."""
        return self.source.data

    @property
    def words(self) -> dict[str, object]:
        """Of its stage."""
        found: dict[str, object] = self.data.about["stages"][self.segment.stage]
        return found

    def travel(self) -> tuple[float, float]:
        """Where a part stood when the segment began, and how far it got from there, metres or radians.

        A part that springs back, as a button, got to where it was pressed to.
        """
        start, last, most = self._moves()
        return start, most if self.springs else last

    @property
    def springs(self) -> bool:
        """Whether the part goes back by itself when it is let go."""
        _, last, most = self._moves()
        return abs(last) < 0.5 * abs(most)

    def _moves(self) -> tuple[float, float, float]:
        """Where the part stood before it was touched, how far from there it was left, and how far it got.

        A button may be down already in the first state in which it is touched.
        """
        assert self.segment.kind == PART
        before = max(self.segment.contact - 1, self.segment.lead)
        path = self.data.joints[self.segment.ref][before : self.segment.end + 1]
        far = path - path[0]
        return float(path[0]), float(far[-1]), float(far[np.argmax(np.abs(far))])


def sources_of(folder: Path, task: str, rules: str = "{}") -> list[Source]:
    """The sources for a task: its own demonstrations, or else those of all tasks in the folder.

    Args:
        folder: that they lie in; or one file.
        task: name.
        rules: JSON of what `rules.rules_from` takes.

    Raises:
        UnfitSourcesError: nothing there has been prepared.
    """
    place = place_of(folder, task)
    found = _read(place, stamp_of(place), rules)
    if not found:
        raise UnfitSourcesError(
            f"{folder}: no demonstration there has been prepared, or none replays. "
            f"`robocasa-lerobot prepare {folder}` makes them ready."
        )
    return list(found)


def place_of(folder: Path, task: str) -> Path:
    """The file of a task's own demonstrations in a folder, or else the folder; or the one file that is given."""
    own = folder / f"{task}.hdf5"
    return own if folder.is_dir() and own.exists() else folder


def first_of_each_task(sources: Sequence[Source], count: int) -> list[Source]:
    """So many sources of each task, numbered anew."""
    seen: dict[str, int] = {}
    found: list[Source] = []
    for source in sources:
        seen[source.task] = seen.get(source.task, 0) + 1
        if seen[source.task] <= count:
            found.append(replace(source, number=len(found)))
    return found


def digest_of(sources: Sequence[Source]) -> str:
    """What tells one set of sources from another."""
    digest = hashlib.sha256(str(VERSION).encode())
    for source in sources:
        digest.update(f"{source.task} {source.seed} {len(source.data)}".encode())
        digest.update(np.ascontiguousarray(source.data.target).tobytes())
    return digest.hexdigest()[:16]


def pieces_for(sources: Sequence[Source], stage: Stage, kind: str, drawn_to: str = "") -> list[Piece]:
    """The segments of a kind from stages like one: of its skill, and of its verb and direction where these matter."""
    found = []
    for source in sources:
        for segment in source.segments:
            words = source.data.about["stages"][segment.stage]
            if segment.kind != kind or words["skill"] != stage.skill:
                continue
            if stage.skill in JOINTED and (words["verb"] != stage.verb or words["drawn_to"] != drawn_to):
                continue
            if kind == USE and not _alike(str(words["verb"]), stage.verb):
                continue
            found.append(Piece(source, segment))
    return found


def _alike(one: str, other: str) -> bool:
    """Whether two verbs use what is held in the same way."""
    return one == other or (one in UNDER_WATER and other in UNDER_WATER)


def stamp_of(place: Path) -> Stamp:
    """Names, times and sizes of the files of a folder, or of one file: what is kept of others is read anew."""
    found = []
    for file in hdf5_files_of(place):
        with contextlib.suppress(FileNotFoundError):
            status = file.stat()
            found.append((file.name, status.st_mtime_ns, status.st_size))
    return tuple(found)


@lru_cache(maxsize=4)
def _read(path: Path, stamp: Stamp, rules: str) -> tuple[Source, ...]:
    found: list[Source] = []
    cuts = rules_from(json.loads(rules))
    for file, demo in demonstrations([path]):
        with h5py.File(file) as opened:
            group = opened[f"data/{demo}"]
            if not is_prepared(group):
                continue
            data = read_prepared(group[GROUP])
            task = str(opened["data"].attrs["env"])
            seed = int(group.attrs.get("seed", -1))
        found.append(Source(len(found), f"{file.stem}/{demo}", task, seed, data, tuple(cut(data, cuts)), cuts))
    return tuple(found)
