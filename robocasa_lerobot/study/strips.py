"""Film strips of a run's trials, solved and not, as one picture: rows of a few frames of one trial each."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.files import written_aside
from robocasa_lerobot.video import DamagedVideoError, spread_frames

MOST_ROWS = 6  # of solved trials, and as many of others
FRAMES = 5
VIEW_PIXELS = 96
_TEXT_PIXELS = 14
_QUALITY = 80


def chosen(records: Sequence[TrialRecord]) -> list[TrialRecord]:
    """The first filmed trial of each task that was solved, and the first that was not, task by task."""
    found = []
    for success in (True, False):
        first: dict[str, TrialRecord] = {}
        for record in records:
            if record.video is not None and record.success is success:
                first.setdefault(record.task, record)
        found += list(first.values())[:MOST_ROWS]
    return found


def write_strips(folder: Path, records: Sequence[TrialRecord], path: Path) -> bool:
    """Write the strips of an evaluation's filmed trials as a JPEG; whether there were any.

    Args:
        folder: of the evaluation.
        records: its trials.
        path: of the picture.
    """
    from PIL import Image, ImageDraw

    rows = []
    for record in chosen(records):
        with contextlib.suppress(FileNotFoundError, DamagedVideoError):
            rows.append((record, spread_frames(folder / str(record.video), FRAMES)))
    if not rows:
        return False
    height = VIEW_PIXELS + _TEXT_PIXELS
    sheet = Image.new("RGB", (FRAMES * 2 * VIEW_PIXELS, height * len(rows)), "white")
    draw = ImageDraw.Draw(sheet)
    for place, (record, pictures) in enumerate(rows):
        what = "solved" if record.success else "not solved"
        where = f"kitchen {record.layout_id}, style {record.style_id}"
        draw.text((2, place * height), f"{record.task}: {what}, {record.steps} steps, {where}", fill="black")
        for column, (_, picture) in enumerate(pictures):
            for number, view in enumerate(_views(picture)):
                shown = Image.fromarray(view).resize((VIEW_PIXELS, VIEW_PIXELS), Image.Resampling.LANCZOS)
                sheet.paste(shown, ((2 * column + number) * VIEW_PIXELS, place * height + _TEXT_PIXELS))
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_aside(path) as aside:
        sheet.save(aside, format="JPEG", quality=_QUALITY, optimize=True)
    return True


def _views(picture: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Of a film's frame, cameras side by side, the left view and the wrist's."""
    width = picture.shape[1] // len(contract.CAMERAS)
    return np.ascontiguousarray(picture[:, :width]), np.ascontiguousarray(picture[:, -width:])
