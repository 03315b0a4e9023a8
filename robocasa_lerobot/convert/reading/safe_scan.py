"""A first walk through demonstration files in a process of its own, which a damaged file may crash or trap.

HDF5 is a C library: on damaged files it has been seen to loop forever (0.6 % of randomly damaged files in HDF5 2.0),
with Python's lock held, so that nothing in the same process could stop it. The walk touches every attribute, header,
index of parts and small array. Where the process dies, the episode that it was in is left alone and the walk starts
again without it. Meanwhile every episode gets a digest, by which copies are found.
"""

from __future__ import annotations

import fnmatch
import hashlib
import json
import math
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from robocasa_lerobot.convert.reading.hdf5 import (
    LEFT_OUT,
    MAX_TEXT_BYTES,
    RejectedEpisodeError,
    SourceError,
    member,
    names,
    reading,
    recorded_attributes,
    shape_and_type,
    text_attribute,
)
from robocasa_lerobot.convert.reading.layout import DEFAULT_EPISODES
from robocasa_lerobot.jobs.child_process import environment_of_python
from robocasa_lerobot.progress import Bar

# Processor time for one attribute, header or small array: so long none takes, however busy the machine is.
CPU_SECONDS = 3.0
_MAX_TRAPS = 5  # more places than these that end the process, and the file is given up
_MAX_DEPTH = 12
_READ_BYTES = 1 << 20  # larger arrays are read in part
_FIRST_PART_BYTES = 64 << 20
_LONG_TEXTS = ("model_file", "ep_meta")  # attributes that may be longer than what a record takes over
_SKIPPED = ("next_obs",)  # never converted
_MODULE = "robocasa_lerobot.convert.reading.safe_scan"


@dataclass
class Survey:
    """What a walk found: why a place (HDF5 path) must not be opened, and digests of groups with `actions`."""

    traps: dict[str, str] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)

    def reason(self, group: str) -> str | None:
        """Why an episode's group must not be opened, or None."""
        inside = (reason for path, reason in self.traps.items() if path == group or path.startswith(f"{group}/"))
        return next(inside, None)


def survey(path: Path, episodes: str = DEFAULT_EPISODES) -> Survey:
    """Walk through a file whose episodes are groups of that pattern.

    Raises:
        SourceError: the process that reads it ends outside of the episodes, or again and again.
    """
    found = Survey()
    while True:
        place, status = _run(path, found)
        if status == 0:
            return found
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        if status == -signal.SIGPROF:
            how = f"not coming to an end in {CPU_SECONDS:g} s"
        if place is None:
            raise SourceError(f"{path} could not be looked into: the reading process ended with {how}.")
        if not _is_inside(place, episodes) or len(found.traps) >= _MAX_TRAPS:
            raise SourceError(f"{path} is damaged: reading {place} ends with {how}. Copy or record it again.")
        found.traps[place] = f"it is damaged: reading {place} ends with {how}."


def _is_inside(place: str, pattern: str) -> bool:
    parts, wanted = place.strip("/").split("/"), pattern.strip("/").split("/")
    return len(parts) >= len(wanted) and all(map(fnmatch.fnmatchcase, parts, wanted))


def _run(path: Path, found: Survey) -> tuple[str | None, int]:
    """Walk in a new process; gives the place where it was last, and its exit status."""
    command = [sys.executable, "-m", _MODULE, str(path), *found.traps]
    place: str | None = None
    with (
        subprocess.Popen(
            command, stdout=subprocess.PIPE, env=environment_of_python(), text=True, errors="replace"
        ) as process,
        Bar(desc=f"looking into {path.name}", unit="episode", delay=2.0, leave=False) as bar,
    ):
        assert process.stdout is not None
        for line in process.stdout:
            event = json.loads(line)
            place = event.get("place", place)
            if "digest" in event:
                found.digests[event["group"]] = event["digest"]
                bar.update()
    return place, process.returncode


def _walk(path: Path, traps: frozenset[str]) -> Iterator[dict[str, str]]:
    """Events of the walk: each place before it is touched, and the digest of each group with `actions`."""
    yield {"place": "/"}
    try:
        with reading("it"):
            file = h5py.File(path, "r")
    except RejectedEpisodeError:
        return  # `DemoFile` names the mistake
    with file:
        yield from _walk_group(file, "", traps, 0, {})


def _walk_group(
    group: h5py.Group, path: str, traps: frozenset[str], depth: int, contents: dict[str, str | None]
) -> Iterator[dict[str, str]]:
    """Walk below a group; `contents` collects the digests of datasets by path, None where one cannot be read."""
    yield {"place": path or "/"}
    _read_attributes(group)
    inside: list[str] = []
    try:
        inside = sorted(names(group, path), key=_natural)
    except RejectedEpisodeError:
        return
    for name in inside:
        place = f"{path}/{name}"
        if place in traps or name in _SKIPPED or depth > _MAX_DEPTH:
            continue
        yield {"place": place}
        try:
            node = member(group, name)
        except RejectedEpisodeError:
            contents[place] = None
            continue
        if isinstance(node, h5py.Group):
            yield from _walk_group(node, place, traps, depth + 1, contents)
        elif node is not None:
            contents[place] = _content(node)
    if f"{path}/actions" in contents:
        digest = _digest(group, path, contents)
        if digest is not None:
            yield {"group": path, "digest": digest}
        contents.clear()


def _read_attributes(node: h5py.Group | h5py.Dataset) -> None:
    try:
        with reading("attributes"):
            keys = list(node.attrs)
    except RejectedEpisodeError:
        return
    for key in keys:
        try:
            with reading(key):
                attribute = node.attrs.get_id(key)
                size = math.prod(attribute.shape or ()) * attribute.dtype.itemsize
                if size <= MAX_TEXT_BYTES:
                    node.attrs[key]
        except RejectedEpisodeError:
            continue


def _content(dataset: h5py.Dataset) -> str | None:
    """Digest of shape, type and values, of a large array of its first row only; None where it cannot be read."""
    _read_attributes(dataset)
    try:
        shape, dtype = shape_and_type(dataset, "it")
        with reading("it"):
            values = b""
            if math.prod(shape) * dtype.itemsize <= _READ_BYTES:
                values = np.asarray(dataset[()]).tobytes()
            elif math.prod(dataset.chunks or (1, *shape[1:])) * dtype.itemsize <= _FIRST_PART_BYTES:
                values = np.asarray(dataset[0]).tobytes()
            return hashlib.blake2b(f"{shape} {dtype} ".encode() + values, digest_size=16).hexdigest()
    except RejectedEpisodeError:
        return None


def _digest(group: h5py.Group, path: str, contents: dict[str, str | None]) -> str | None:
    """Digest of an episode's attributes and of what lies below it; None where something cannot be read."""
    mine = {place.removeprefix(path): content for place, content in contents.items() if place.startswith(f"{path}/")}
    if None in mine.values():
        return None
    try:
        texts = [text_attribute(group, key) for key in _LONG_TEXTS]
        short = [(key, value) for key, value in recorded_attributes(group).items() if key != LEFT_OUT]
        content = json.dumps([texts, sorted(short), sorted(mine.items())])
        return hashlib.blake2b(content.encode(), digest_size=16).hexdigest()
    except (RejectedEpisodeError, ValueError, TypeError):
        return None


def _natural(name: str) -> tuple[int, str]:
    digits = name.rpartition("_")[2]
    return (int(digits) if digits.isascii() and digits.isdecimal() and len(digits) < 19 else -1, name)


def main(arguments: Sequence[str]) -> None:
    """Write the events of a walk as JSON lines; arguments are the file and the places to leave alone."""
    path, *traps = arguments
    for event in _walk(Path(path), frozenset(traps)):
        sys.stdout.write(json.dumps(event) + "\n")
        sys.stdout.flush()
        # The kernel ends this process when the time runs out, wherever it is.
        signal.setitimer(signal.ITIMER_PROF, CPU_SECONDS)


if __name__ == "__main__":
    main(sys.argv[1:])
