"""Fixtures of the tests of servers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from serving_support import serving
from tiny_checkpoint import checkpoint

from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import load_served

__all__ = ["checkpoint"]


@pytest.fixture(scope="module")
def in_process(checkpoint: Path) -> ChunkPolicy:
    """The tiny policy as an evaluation in this process computes it."""
    return ChunkPolicy(LoadedCheckpoint(read_source(str(checkpoint)), "cpu", None), 1)


@pytest.fixture(scope="module")
def openpi_port(checkpoint: Path) -> Iterator[int]:
    """The tiny policy served over openpi's wire."""
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "openpi") as port:
        yield port
