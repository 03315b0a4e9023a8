"""Fixtures of several tests of jobs."""

from ray_support import ray

__all__ = ["ray"]
