"""What tests of training share, where a module has nothing of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from robocasa_lerobot.data.fake import write_fake_dataset


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of four short episodes."""
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=12, image_size=32)


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)
