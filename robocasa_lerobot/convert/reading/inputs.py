"""Whether what a command was given is there: asked before LeRobot is imported, which takes seconds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robocasa_lerobot.convert.reading.hdf5 import MAX_IMAGE_SIDE, SourceError
from robocasa_lerobot.convert.record_files import CONVERSION_FILE, META_FOLDER
from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.hdf5_files import hdf5_files_of

INFO_FILE = "meta/info.json"  # of LeRobot datasets of all versions
_MIN_IMAGE_SIDE = 16


def is_dataset(path: Path) -> bool:
    """Whether this is the folder of a LeRobot dataset of any version."""
    return (path / INFO_FILE).is_file()


def check_demo_file(path: Path) -> None:
    """Check that there is a file.

    Raises:
        SourceError: there is none; it names the most alike.
    """
    if path.is_dir():
        raise SourceError(f"{path} is a folder without HDF5 files, and no dataset either: {INFO_FILE} is not there.")
    if not path.is_file():
        siblings = [p.name for p in path.parent.glob("*")] if path.parent.is_dir() else []
        raise SourceError(f"{path} does not exist; an HDF5 file is needed. {suggest(path.name, siblings)}")


def demo_files(paths: Sequence[Path]) -> list[Path]:
    """Files and folders of datasets as they are given, and of other folders the HDF5 files in them, by name.

    Raises:
        SourceError: as `check_demo_file`.
    """
    found: list[Path] = []
    for path in paths:
        files = [path] if is_dataset(path) else hdf5_files_of(path)
        for file in [] if is_dataset(path) else files or [path]:
            check_demo_file(file)
        found += files
    return found


def check_dataset(root: Path) -> None:
    """Check that a folder has what every LeRobot dataset has.

    Raises:
        UserError: it has not.
    """
    if not is_dataset(root):
        raise UserError(f"{root} is no LeRobot dataset: {INFO_FILE} is not there.")


def check_converted(root: Path) -> None:
    """Check that a folder is a dataset that `convert` has written.

    Raises:
        UserError: it is none.
    """
    if not (root / META_FOLDER / CONVERSION_FILE).is_file():
        what = "a dataset without our records" if is_dataset(root) else "no dataset"
        raise UserError(f"{root} is {what}: {META_FOLDER}/{CONVERSION_FILE}, which `convert` writes, is not there.")


def check_image_size(size: int | None) -> None:
    """Check that pictures of `size` pixels in height and width can be made and encoded; None is no wish.

    Raises:
        UserError: it is odd, too small or too large.
    """
    if size is not None and (size % 2 or not _MIN_IMAGE_SIDE <= size <= MAX_IMAGE_SIDE):
        raise UserError(
            f"the image size {size} is not possible: an even number from {_MIN_IMAGE_SIDE} to {MAX_IMAGE_SIDE} is "
            "needed (video)."
        )
