"""Fixtures of several tests of conversion."""

from slurm_support import slurm

__all__ = ["slurm"]
