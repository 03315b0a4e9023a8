"""LeRobot's viewer reads frames of datasets with stages, whose language has fields that are None."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import torch
from torch.utils.data import DataLoader
from robocasa_lerobot.data.viewer import allow_none
row = {"role": "assistant", "content": "open it", "style": "subtask", "timestamp": 0.0, "camera": None}
frames = [{"action": torch.ones(2), "language_persistent": [dict(row)]} for _ in range(3)]
try:
    next(iter(DataLoader(frames, batch_size=3)))
except TypeError as error:
    print("before:", "NoneType" in str(error))
allow_none()
batch = next(iter(DataLoader(frames, batch_size=3)))
(rows,) = batch["language_persistent"]
print("after:", rows["camera"], rows["content"], tuple(batch["action"].shape))
"""


def test_frames_with_none_make_a_batch() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "before: True",
        "after: [None, None, None] ['open it', 'open it', 'open it'] (3, 2)",
    ]


@pytest.mark.costly
def test_it_takes_the_viewers_own_arguments() -> None:
    command = [sys.executable, "-m", "robocasa_lerobot.data.viewer", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "--episode-index" in done.stdout


def test_a_folder_that_is_no_dataset_is_said(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "robocasa_lerobot.data.viewer", "--repo-id=a/b", f"--root={tmp_path / 'dta'}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "found no meta/info.json there" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "dta").exists()
