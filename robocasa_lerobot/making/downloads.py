"""Conversion of published folders (LeRobot v2.0 and v2.1) in bulk: each appears complete or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.benchmark.tasks import published_tasks
from robocasa_lerobot.data.registry.published import CONVERTED, dataset_version
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import Execution
from robocasa_lerobot.making.needs import WORK, Need
from robocasa_lerobot.making.pieces import Outcome, run_pieces

_PRELOAD = ("robocasa_lerobot.convert.lerobot_v2.shard",)


@dataclass(frozen=True)
class Download:
    """A piece: a published folder, and where its conversion goes."""

    source: Path
    out: Path
    folder: Path  # of the whole conversion, for unfinished files

    @property
    def name(self) -> str:
        """Its folder."""
        return str(self.source)

    @property
    def work(self) -> Path:
        """For its log."""
        return self.folder / "_".join(self.source.parts[-6:])

    @property
    def size(self) -> int:
        """One dataset."""
        return 1

    def done(self) -> float:
        """Whether it is converted."""
        return float(dataset_version(self.out) == "v3.0")

    def make(self, workers: int) -> str:
        """Convert it; there is nothing to tell."""
        from robocasa_lerobot.convert.pipeline import convert
        from robocasa_lerobot.convert.settings import ConversionSettings

        if not self.done():
            self.out.parent.mkdir(parents=True, exist_ok=True)
            convert([self.source], self.out, ConversionSettings(), workers)
        return ""


def find_downloads(folder: Path, to: Path | None = None, needs: Sequence[Need] | None = None) -> list[Download]:
    """The LeRobot v2 datasets below a folder that are not converted yet.

    Args:
        folder: of downloads, searched through.
        to: folder in which they get the same places; None puts each beside its source, with `_v3` after the name.
        needs: only those that these say are missing; None is all.

    Raises:
        UserError: no such folder, or no LeRobot dataset in it.
    """
    if not folder.is_dir():
        raise UserError(f"--convert: no folder {folder}. Give the one that the published datasets were put into.")
    found = list(_datasets(folder))
    if not found:
        raise UserError(f"--convert: {folder} has no LeRobot dataset (no folder with meta/info.json).")
    wanted = None if needs is None else {(need.task, need.split, need.source) for need in needs if need.missing}
    work = (to or folder) / WORK
    out: list[Download] = []
    for source in found:
        version = dataset_version(source)
        if version is None or not version.startswith("v2") or (wanted is not None and _what(source) not in wanted):
            continue
        place = source.with_name(source.name + CONVERTED) if to is None else to / source.relative_to(folder)
        download = Download(source, place, work)
        if not download.done():
            out.append(download)
    return out


def convert_downloads(downloads: Sequence[Download], execution: Execution, cores: int) -> Outcome:
    """Convert them; see `run_pieces`."""
    outcome = run_pieces(downloads, downloads[0].folder, execution, cores, "converting", "dataset", _PRELOAD)
    if not outcome.submitted and not outcome.failed:
        with contextlib.suppress(OSError):
            downloads[0].folder.rmdir()
    return outcome


def _datasets(folder: Path) -> Iterator[Path]:
    """Folders with LeRobot's metadata, in order; nothing is looked for inside them. Links are followed."""
    for place, inside, _ in os.walk(folder, followlinks=True):
        if (Path(place) / "meta" / "info.json").is_file():
            inside.clear()
            yield Path(place)
        else:
            here = Path(place).resolve()
            inside[:] = sorted(
                name
                for name in inside
                if not name.startswith(".") and not here.is_relative_to((here / name).resolve())  # a link upwards
            )


def _what(source: Path) -> tuple[str, str, str] | None:
    """Task, split and source of a folder `<split>/<kind>/<Task>/<date>[/<source>/demo/<time>]/<views>`.

    A relative path may begin anywhere in it.
    """
    parts = source.absolute().parts
    for number, task in enumerate(parts):
        if number >= 2 and task in published_tasks() and parts[number - 1] == published_tasks()[task][0]:
            inner = parts[number + 2 : -1]
            return task, parts[number - 2], inner[0] if inner else "human"
    return None
