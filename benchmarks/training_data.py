"""The dataset that `training_speed.py` trains on: a few demonstrations through our converter, or made-up frames."""

from __future__ import annotations

from pathlib import Path

import convert_demos

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError

FAKE_FRAMES = 120  # of each made-up episode


def converted(folder: Path, episodes: int, workers: int) -> Path:
    """A dataset of recorded demonstrations with three cameras, made once."""
    from robocasa_lerobot.convert import pipeline
    from robocasa_lerobot.convert.settings import ConversionSettings

    demos = convert_demos.record(folder, episodes, workers)
    root = demos.images.parent / "dataset"
    if not root.exists():
        pipeline.convert([demos.images], root, ConversionSettings(), workers)
    return root


def fake(folder: Path, episodes: int, image_size: int = contract.IMAGE_SIZE, frames: int = FAKE_FRAMES) -> Path:
    """A dataset of smooth made-up pictures, which decode faster than real ones; made once."""
    from robocasa_lerobot.data.fake import write_fake_dataset

    root = folder / f"fake-{episodes}-{image_size}"
    if not root.exists():
        write_fake_dataset(root, episodes, frames, image_size)
    return root


def check(root: Path) -> Path:
    """The folder itself, if it is a dataset.

    Raises:
        UserError: it is none.
    """
    if not (root / "meta" / "info.json").is_file():
        raise UserError(f"{root} is no LeRobotDataset v3.0 (no meta/info.json); give the folder that holds `meta`.")
    return root
