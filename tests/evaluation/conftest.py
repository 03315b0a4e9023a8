"""Fixtures of several tests of evaluation."""

from slurm_support import slurm
from tiny_checkpoint import checkpoint

__all__ = ["checkpoint", "slurm"]
