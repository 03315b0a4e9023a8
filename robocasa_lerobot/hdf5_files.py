"""HDF5 files that appear whole or not at all, and whose faults are those of the disk; those of a folder."""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Buffer, Iterator
from pathlib import Path

import h5py

from robocasa_lerobot.files import written_aside


def hdf5_files_of(path: Path) -> list[Path]:
    """The HDF5 files in a folder, by name; a path that is no folder stands for itself."""
    return sorted(path.glob("*.hdf5")) if path.is_dir() else [path]


class _Shielded(io.FileIO):
    """A file in which no write seems to fail to HDF5; `error` is what failed first.

    On a full disk HDF5 2.0 raises RuntimeError from its own bookkeeping when a file is closed, and where datasets are
    compressed it ends the whole process.
    """

    error: OSError | None = None

    def write(self, data: Buffer, /) -> int:
        """Write all of it, or note why not."""
        left = memoryview(data).cast("B")
        size = len(left)
        while len(left) and self.error is None:
            try:
                left = left[super().write(left) :]
            except OSError as error:
                self.error = error
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """Cut or extend, or note why not."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0


@contextlib.contextmanager
def new_hdf5(path: Path) -> Iterator[h5py.File]:
    """A file to fill, which appears at `path` only when complete.

    Raises:
        OSError: it cannot be written, or what HDF5 was told to copy cannot be read.
    """
    with written_aside(path) as aside, _opened(aside, path, "w") as file:
        yield file


@contextlib.contextmanager
def changed_hdf5(path: Path) -> Iterator[h5py.File]:
    """A copy of a file to change, which takes the place of `path` only when complete.

    Raises:
        OSError: it cannot be read or written.
    """
    with written_aside(path) as aside:
        shutil.copyfile(path, aside)
        with _opened(aside, path, "r+") as file:
            yield file


@contextlib.contextmanager
def _opened(aside: Path, path: Path, mode: str) -> Iterator[h5py.File]:
    with _Shielded(aside, "w+" if mode == "w" else mode) as shielded:
        try:
            with h5py.File(shielded, mode) as file:
                yield file
        except RuntimeError as error:  # what HDF5 has no better word for
            if shielded.error is None:
                raise OSError(f"{path} cannot be written: {error}") from error
        except Exception:
            if shielded.error is None:
                raise
        if shielded.error is not None:
            raise OSError(shielded.error.errno, shielded.error.strerror, str(path)) from shielded.error
