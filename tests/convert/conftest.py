"""Fixtures of several tests of conversion."""

from __future__ import annotations

import multiprocessing

import multiprocess
import pytest
from forkservers import start_anew
from slurm_support import slurm

__all__ = ["slurm"]


@pytest.fixture(scope="package", autouse=True)
def _forked_with_conversion() -> None:
    start_anew(multiprocess, ["robocasa_lerobot.convert.shard", "robocasa_lerobot.convert.rerender.work"])
    start_anew(multiprocessing, ["robocasa_lerobot.convert.verify"])
