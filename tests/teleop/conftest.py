"""Fixtures of several tests of driving by hand."""

from tiny_checkpoint import checkpoint

__all__ = ["checkpoint"]
