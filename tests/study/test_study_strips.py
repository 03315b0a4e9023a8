"""The picture of a run's films: a row of frames for each trial that is shown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from evaluation_records import record
from PIL import Image

from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.study.strips import FRAMES, VIEW_PIXELS, chosen, write_strips
from robocasa_lerobot.video import VideoWriter

HEIGHT = 128


def film(path: Path, left: int, wrist: int, frames: int) -> None:
    """Grey pictures of three cameras side by side, of which the wrist's gets darker."""
    with VideoWriter(path, 10) as writer:
        for number in range(frames):
            views = [np.full((HEIGHT, HEIGHT, 3), value, np.uint8) for value in (left, 0, wrist - 10 * number)]
            writer.write(np.concatenate(views, axis=1))


def trial(task: str, number: int, success: bool, video: str | None) -> TrialRecord:
    return record(task=task, trial=number, success=success, first_success_step=5 if success else None, video=video)


def test_the_first_film_of_each_task_and_outcome_is_chosen() -> None:
    records = [
        trial("A", 0, False, None),
        trial("A", 1, False, "a1"),
        trial("A", 2, True, "a2"),
        trial("A", 3, True, "a3"),
        trial("B", 0, False, "b0"),
    ]
    assert [one.video for one in chosen(records)] == ["a2", "a1", "b0"]


def test_a_row_has_frames_from_the_first_to_the_last(tmp_path: Path) -> None:
    film(tmp_path / "one.mp4", left=200, wrist=150, frames=9)
    film(tmp_path / "two.mp4", left=50, wrist=100, frames=2)
    (tmp_path / "cut.mp4").write_bytes((tmp_path / "one.mp4").read_bytes()[:300])  # copied in part
    records = [trial("A", 0, True, "one.mp4"), trial("A", 1, False, "two.mp4"), trial("B", 0, False, "gone.mp4")]
    records.append(trial("C", 0, False, "cut.mp4"))
    out = tmp_path / "strips" / "sheet.jpg"
    assert write_strips(tmp_path, records, out)
    sheet = np.asarray(Image.open(out).convert("L")).astype(int)
    row = sheet.shape[0] // 2
    assert sheet.shape[1] == FRAMES * 2 * VIEW_PIXELS
    middle = row - VIEW_PIXELS // 2

    def seen(place: int, view: int) -> int:
        return int(sheet[place * row + middle, view * VIEW_PIXELS + VIEW_PIXELS // 2])

    assert abs(seen(0, 0) - 200) < 8
    assert [round(seen(0, 2 * frame + 1), -1) for frame in range(FRAMES)] == [150, 130, 110, 90, 70]
    assert [abs(seen(1, view) - value) < 8 for view, value in enumerate((50, 100, 50, 90, 255))] == [True] * 5


def test_without_films_there_is_no_picture(tmp_path: Path) -> None:
    assert not write_strips(tmp_path, [trial("A", 0, True, None)], tmp_path / "sheet.jpg")
    assert not (tmp_path / "sheet.jpg").exists()
