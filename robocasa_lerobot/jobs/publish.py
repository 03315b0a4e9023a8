"""A result that appears at once: a folder beside the output, which one process at a time fills, and one rename."""

from __future__ import annotations

import contextlib
import glob
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.locks import LockHeldError, locked

_LOCK, _DONE = "lock", "done"
_PARTIAL = ".partial-"  # between an output's name and the fingerprint of the work on it


def output_path(out: Path) -> Path:
    """Where a dataset is to appear: absolute, and where a link points to, which stays."""
    return out.resolve() if out.is_symlink() else out.absolute()


def check_output(out: Path, overwrite: bool) -> None:
    """Whether a dataset may appear at `out`.

    Raises:
        UserError: there is something.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not overwrite:
        raise UserError(f"{out} exists already. Choose another --out, or replace it with --overwrite.")
    if not (out / "meta" / "info.json").is_file():
        raise UserError(f"{out} is not a LeRobotDataset, so --overwrite leaves it alone. Choose another --out.")
    if others := sorted(out.glob("*/meta/info.json")):
        names = ", ".join(path.parents[1].name for path in others[:3])
        raise UserError(
            f"{out} holds other datasets beside its own ({names}), so --overwrite leaves it alone. Move them away, or "
            "choose another --out."
        )


def check_outside(out: Path, source: Path) -> None:
    """Whether a dataset may be made at `out` from a file or folder `source`.

    Raises:
        UserError: it would be inside, and copied into itself; or the source is inside, or is that itself, and would go
            with what is replaced.
    """
    inside, outside = source.resolve(), out.resolve()
    if inside in outside.parents:
        raise UserError(f"--out {out} is inside the dataset {source}. Choose a folder beside it.")
    if outside == inside:
        raise UserError(f"--out is the source itself: {out}. Choose another folder.")
    if outside in inside.parents:
        raise UserError(f"{source} is inside --out {out}, and would be replaced with it. Choose another --out.")


def partial_folder(out: Path, fingerprint: str) -> Path:
    """Where the work is done: named by what decides its bytes, so that the same command finds it again."""
    return out.with_name(f"{out.name}{_PARTIAL}{fingerprint}")


def partial_folders(out: Path) -> list[Path]:
    """Where work on an output has been begun, by whatever settings."""
    return sorted(out.parent.glob(f"{glob.escape(out.name)}{_PARTIAL}*"))


@contextlib.contextmanager
def held_folder(partial: Path) -> Iterator[None]:
    """Make the folder and keep others out of it.

    Raises:
        UserError: the same work is running already, or the folder cannot be made.
    """
    with contextlib.ExitStack() as stack:
        try:
            partial.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(partial / _LOCK, wait=False))
        except LockHeldError:
            raise UserError(f"the same work is running already (it holds {partial}). Wait until it ends.") from None
        except OSError as error:
            raise UserError(f"nothing can be written beside the output: {error}. Choose another --out.") from None
        yield


@contextlib.contextmanager
def held_lock(folder: Path) -> Iterator[None]:
    """Make the folder, which holds nothing but a lock, keep others out, and remove it at the end; see `held_folder`."""
    with held_folder(folder):
        try:
            yield
        finally:
            shutil.rmtree(folder, ignore_errors=True)  # before it is released


@contextlib.contextmanager
def failures_explained(out: Path, partial: Path) -> Iterator[None]:
    """Turn errors of the file system, such as a full disk, into ones that name the kept files and a remedy."""
    try:
        yield
    except OSError as error:
        raise UserError(
            f"writing failed: {error}. Nothing is at {out}; finished parts are kept in {partial}: free disk "
            "space and give the same command to go on."
        ) from error


def publish(merged: Path, out: Path, replaced: Path) -> None:
    """Let the finished dataset appear at `out` by a rename, after moving an old one aside; see `is_done`."""
    (merged.parent / _DONE).touch()
    if out.exists():
        shutil.rmtree(replaced, ignore_errors=True)
        out.rename(replaced)
    merged.rename(out)


def is_done(merged: Path) -> bool:
    """Whether nothing is left to do in the held folder in which `merged` was made: it has appeared at its place."""
    names = {path.name for path in merged.parent.iterdir()} - {_LOCK}
    return merged.name not in names and (_DONE in names or not names)


def go_on(merged: Path) -> None:
    """Make a held folder fit for the work that is asked for, whatever a kill has left in it.

    What is there of a work that is done was being cleared away, and lacks parts that say they are complete.
    """
    done = merged.parent / _DONE
    if done.exists():
        if not merged.exists():
            _empty(merged.parent)
        done.unlink()  # there is something to do again


def clear_away(folder: Path) -> None:
    """Remove the held folder of a work that is done; what says so goes last, in case of a kill meanwhile.

    Where that fails, as on a network file system that keeps open files, it is said and left alone: the work is done.
    """
    try:
        (folder / _DONE).touch()
        _empty(folder)
        for name in (_LOCK, _DONE):
            (folder / name).unlink(missing_ok=True)
        folder.rmdir()
    except OSError as error:
        print(f"{folder} could not be removed ({error}); nothing needs it any more.", file=sys.stderr)


def _empty(folder: Path) -> None:
    """Remove what is in a held folder but its lock and what says that it is done."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name not in (_LOCK, _DONE):
            path.unlink(missing_ok=True)


def make_piece(folder: Path, make: Callable[[Path], object]) -> None:
    """Let `make` fill a folder that then gets its name; nothing is done where it is there already.

    Each process fills one of its own, since the worker of a run that was killed may still be at the same piece for a
    moment. Whoever is first wins: the bytes are the same.
    """
    if folder.exists():
        return  # complete; only the executor's marker was lost
    attempt = folder.with_name(f"{folder.name}.attempt-{platform.node()}-{os.getpid()}")
    shutil.rmtree(attempt, ignore_errors=True)
    attempt.mkdir(parents=True)
    make(attempt)
    try:
        attempt.rename(folder)
    except OSError:
        if not folder.exists():
            raise
        shutil.rmtree(attempt)
