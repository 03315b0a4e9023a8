"""Generated files kept on disk, so that a machine makes each of them once instead of once in each process.

They lie in the folder that the environment variable `ROBOCASA_LEROBOT_CACHE` names, else in the user's cache folder.
Where nothing can be written, as in a read-only container, every process makes its own.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import PIL
import platformdirs

from robocasa_lerobot.files import written_aside

CACHE_VARIABLE = "ROBOCASA_LEROBOT_CACHE"
_CHECKSUM_BYTES = 4


def kept(folder: str, name: str, made_from: object, made_by: str, make: Callable[[], bytes]) -> bytes:
    """Bytes that are a function of `made_from`: those on the disk, else `make` makes them and they are put there.

    Args:
        folder: below the cache's.
        name: what the file's name begins with.
        made_from: all that they depend on, of a type whose `repr` tells it in full and in every process alike.
        made_by: `stamp` of the code that makes them; what another version has made is not taken.
        make: makes them.
    """
    digest = hashlib.sha256(f"{made_from!r} {made_by}".encode()).hexdigest()[:16]
    file = cache_folder() / folder / f"{name}_{digest}"
    with contextlib.suppress(OSError):
        content = file.read_bytes()
        body = content[:-_CHECKSUM_BYTES]
        if content[-_CHECKSUM_BYTES:] == _checksum(body):  # else a disk that was full has cut it
            return body
    body = make()
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with written_aside(file, by_many=True) as aside:
            aside.write_bytes(body + _checksum(body))
    return body


def cache_folder() -> Path:
    """Where files lie that are only kept to be quicker; it may be removed at any time."""
    named = os.environ.get(CACHE_VARIABLE)
    return Path(named) if named else platformdirs.user_cache_path("robocasa_lerobot", appauthor=False)


@functools.cache
def stamp(*sources: Path) -> str:
    """What changes when the code or the records in some files and folders do, or the libraries that draw."""
    files = [file for source in sources for file in (sorted(source.rglob("*")) if source.is_dir() else [source])]
    digest = hashlib.sha256()
    for file in files:
        if file.suffix in (".py", ".yaml"):
            digest.update(file.read_bytes())
    return f"{digest.hexdigest()} {np.__version__} {PIL.__version__}"


def _checksum(content: bytes) -> bytes:
    return zlib.crc32(content).to_bytes(_CHECKSUM_BYTES, "little")
