"""Fixtures of several tests of evaluation."""

from ray_support import ray
from slurm_support import slurm
from tiny_checkpoint import checkpoint

__all__ = ["checkpoint", "ray", "slurm"]
