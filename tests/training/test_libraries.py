"""What all tests stand on: no network and one thread, though this folder's own conftest imports torch and the hub."""

from __future__ import annotations

import os


def test_libraries_have_read_what_the_tests_set() -> None:
    """They read it when they are imported; folders' own conftests import some of them before pytest is configured."""
    import huggingface_hub.constants
    import torch

    assert huggingface_hub.constants.HF_HUB_OFFLINE
    assert huggingface_hub.constants.HF_HOME == os.environ["HF_HOME"]
    assert torch.get_num_threads() == int(os.environ["OMP_NUM_THREADS"])
