"""Textures kept on disk, so that a machine draws each of them once instead of once in each process."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import PIL
import platformdirs

CACHE_VARIABLE = "ROBOCASA_LEROBOT_CACHE"
_PNG_END = b"IEND\xaeB`\x82"


def kept(name: str, made_from: object, drawn_by: Path, draw: Callable[[], bytes]) -> bytes:
    """PNG bytes of a picture: those on the disk, else `draw` makes them and they are put there.

    They lie in the folder that the environment variable `ROBOCASA_LEROBOT_CACHE` names, else in the user's cache
    folder. Where nothing can be written, as in a read-only container, every process draws for itself.

    Args:
        name: what the file's name begins with.
        made_from: all that the picture depends on, of a type whose `repr` tells it in full.
        drawn_by: source file of the functions that draw; pictures of another version of it are not taken.
        draw: makes the picture.
    """
    digest = hashlib.sha256(f"{made_from!r} {_stamp(drawn_by)}".encode()).hexdigest()[:16]
    file = cache_folder() / "textures" / f"{name}_{digest}.png"
    try:
        content = file.read_bytes()
    except OSError:
        content = b""
    if content.endswith(_PNG_END):  # else a disk that was full has cut it
        return content
    content = draw()
    _write(file, content)
    return content


def cache_folder() -> Path:
    """Where files lie that are only kept to be quicker; it may be removed at any time."""
    named = os.environ.get(CACHE_VARIABLE)
    return Path(named) if named else platformdirs.user_cache_path("robocasa_lerobot", appauthor=False)


def _write(file: Path, content: bytes) -> None:
    # Several processes may draw the same at once: each writes aside under its own name, and the last one stays.
    aside = file.with_name(f"{file.name}.{os.getpid()}.partial")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        aside.write_bytes(content)
        aside.replace(file)
    except OSError:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)


@functools.cache
def _stamp(source: Path) -> str:
    """What changes when a picture may: the code that draws, and the libraries that it draws with."""
    return f"{hashlib.sha256(source.read_bytes()).hexdigest()} {np.__version__} {PIL.__version__}"
