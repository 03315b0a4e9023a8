"""Which software made a result."""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
from pathlib import Path

import robocasa_lerobot

PACKAGES = ("lerobot", "mujoco", "torch", "gymnasium", "numpy")


def versions() -> dict[str, str]:
    """Versions of this package, of Python and of what simulates and infers; without importing any of them."""
    out = {"robocasa_lerobot": robocasa_lerobot.__version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out


def git_commit() -> str | None:
    """Commit of the checkout that this package runs from, with `-dirty` when tracked files differ; None elsewhere."""
    root = Path(robocasa_lerobot.__file__).parents[1]
    if not (root / ".git").exists():
        return None
    try:
        commit = _git(root, "rev-parse", "HEAD")
        dirty = _git(root, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return None
    return commit + ("-dirty" if dirty else "")


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=20, check=True)
    return done.stdout.strip()
