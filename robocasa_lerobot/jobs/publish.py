"""A result that appears at once: a folder beside the output, which one process at a time fills, and one rename."""

from __future__ import annotations

import contextlib
import os
import platform
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.locks import LockHeldError, locked

_LOCK, _DONE = "lock", "done"


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
    """Whether a dataset may be made at `out` from the folder `source`.

    Raises:
        UserError: it would be inside, and copied into itself.
    """
    if source.resolve() in out.resolve().parents:
        raise UserError(f"--out {out} is inside the dataset {source}. Choose a folder beside it.")


def partial_folder(out: Path, fingerprint: str) -> Path:
    """Where the work is done: named by what decides its bytes, so that the same command finds it again."""
    return out.with_name(f"{out.name}.partial-{fingerprint}")


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


def clear_away(folder: Path) -> None:
    """Remove the held folder of a work that is done; what says so goes last, in case of a kill meanwhile."""
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name not in (_LOCK, _DONE):
            path.unlink(missing_ok=True)
    for name in (_LOCK, _DONE):
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()


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
