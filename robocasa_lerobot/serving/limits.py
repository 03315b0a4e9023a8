"""Bounds of what clients can make a server hold."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """The largest message, bytes, and how many clients are served at a time."""

    message_bytes: int = 16 * 2**20  # three pictures of 1024x1024 with a history of one, and more than twice that
    clients: int = 64
