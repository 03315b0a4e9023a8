"""A file without a name, for what two processes share: nobody else sees it, and it is gone when both are."""

from __future__ import annotations

import os
import tempfile


def anonymous_file(label: str) -> int:
    """File descriptor of a new file without a name, in memory where the system has such files.

    Raises:
        OSError: the system has no room for it.
    """
    if hasattr(os, "memfd_create"):
        return os.memfd_create(label)
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())
