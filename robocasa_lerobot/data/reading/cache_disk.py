"""What the caches on disk have in common: one process fills, the others wait, and a full disk is told beforehand."""

from __future__ import annotations

import shutil
from pathlib import Path

from robocasa_lerobot.errors import UserError

_FILLED = 0.9  # part of the free disk that a cache may take


def check_disk(needed: int, folder: Path, what: str, remedy: str) -> None:
    """Check that `needed` bytes fit into the disk of `folder`.

    Raises:
        UserError: they do not; `remedy` says what else to do than take another disk.
    """
    free = shutil.disk_usage(folder).free
    if needed > _FILLED * free:
        raise UserError(
            f"{what} needs {needed / 1e9:.1f} GB but {folder} has {free / 1e9:.1f} GB free. Set `loader.cache_dir` to "
            f"a larger disk{remedy}."
        )
