"""Which software made a result."""

from __future__ import annotations

import datetime
import functools
import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path

import robocasa_lerobot

# What `make study` writes as it goes, which changes nothing of what it runs next.
_WRITTEN_BY_US = ("docs/results", "docs/results.md")


def utc_now() -> str:
    """This moment, ISO 8601 with seconds."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def versions(*packages: str) -> dict[str, str]:
    """Versions of this package, of Python and of the packages named; without importing any of them."""
    out = {"robocasa_lerobot": robocasa_lerobot.__version__, "python": platform.python_version()}
    for name in packages:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out


def machine() -> dict[str, str]:
    """What this process runs on: system, processor and cores; and its NVIDIA GPUs, where the driver lists any."""
    return {
        "system": f"{platform.system()} {platform.release()}",
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "gpus": ", ".join(_gpus()) or "none",
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def _gpus() -> list[str]:
    found = []
    for file in sorted(Path("/proc/driver/nvidia/gpus").glob("*/information")):
        lines = file.read_text(encoding="utf-8").splitlines()
        found += [line.partition(":")[2].strip() for line in lines if line.startswith("Model")]
    return found


@functools.cache
def git_commit(*beside: str) -> str | None:
    """Commit of the checkout that this package runs from, with `-dirty` when tracked files differ; None elsewhere.

    `beside` are files and folders of the checkout whose changes do not count, as those of the study's results.
    """
    root = Path(robocasa_lerobot.__file__).parents[1]
    if not (root / ".git").exists():
        return None
    try:
        commit = _git(root, "rev-parse", "HEAD")
        dirty = _git(
            *(root, "status", "--porcelain", "--untracked-files=no", "--", "."),
            *(f":!{path}" for path in (*_WRITTEN_BY_US, *beside)),
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return commit + ("-dirty" if dirty else "")


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=20, check=True)
    return done.stdout.strip()
