"""Fixtures of several tests of evaluation."""

from __future__ import annotations

import multiprocessing

import pytest
from forkservers import start_anew
from ray_support import ray
from slurm_support import slurm
from tiny_checkpoint import checkpoint

from robocasa_lerobot.evaluation.imports.policy_imports import POLICY_MODULES

__all__ = ["checkpoint", "ray", "slurm"]


@pytest.fixture(scope="package", autouse=True)
def _forked_with_policies() -> None:
    start_anew(multiprocessing, POLICY_MODULES)
