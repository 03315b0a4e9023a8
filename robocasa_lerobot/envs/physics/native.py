"""Compiled code: the decorator that makes it, and MuJoCo's shared library made known to it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import mujoco
from llvmlite import binding
from numba import njit


def compiled[**P, T](function: Callable[P, T]) -> Callable[P, T]:
    """Compile `function` with numba on its first call and keep the machine code on disk.

    The code goes beside the source, else into the user's cache folder (`NUMBA_CACHE_DIR`); where nothing can be
    written, as in a read-only container, every process compiles for itself.
    """
    try:
        made = njit(cache=True, nogil=True)(function)
    except RuntimeError:  # numba found no folder that it may write to
        return njit(nogil=True)(function)
    # Numba would take code from the disk as long as the function's own file is as it was, whatever it calls.
    kept = getattr(getattr(made, "_cache", None), "_cache_file", None)
    if kept is not None and hasattr(kept, "_source_stamp"):
        kept._source_stamp = _stamp(Path(function.__code__.co_filename).parent)
    return made


@cache
def _stamp(folder: Path) -> tuple[tuple[str, int, int], ...]:
    """What changes when a module of a folder does."""
    return tuple((file.name, file.stat().st_mtime_ns, file.stat().st_size) for file in sorted(folder.glob("*.py")))


def inlined[**P, T](function: Callable[P, T]) -> Callable[P, T]:
    """As `compiled`, of what is put into each compiled function that calls it: for a few lines called very often."""
    return njit(nogil=True, inline="always")(function)


def _say_nothing(text: str) -> None:
    """In place of MuJoCo's own handler, which appends to a file that parallel processes share."""


@cache
def load() -> Path:
    """Load the library that the `mujoco` package itself uses, so that its functions resolve, and return its path.

    From then on MuJoCo's warnings write no MUJOCO_LOG.TXT into the working folder, unless the process has its own
    handler: what they are about, unstable physics, is raised where it happens.

    Raises:
        ImportError: the package has no shared library where its wheels carry it.
    """
    folder = Path(mujoco.__file__).parent
    version = mujoco.mj_versionString()
    names = (f"libmujoco.so.{version}", f"libmujoco.{version}.dylib", "mujoco.dll")
    for name in names:
        if (folder / name).is_file():
            binding.load_library_permanently(str(folder / name))
            if mujoco.get_mju_user_warning() is None:
                mujoco.set_mju_user_warning(_say_nothing)
            return folder / name
    raise ImportError(
        f"no MuJoCo library in {folder}: looked for {', '.join(names)}. "
        "Install mujoco from its wheel: pip install --force-reinstall mujoco"
    )
