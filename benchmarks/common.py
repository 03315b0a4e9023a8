"""What every benchmark needs: a description of the machine, versions, spreads, a table, and results on disk."""

from __future__ import annotations

import argparse
import importlib.metadata
import io
import json
import os
import platform
import statistics
import subprocess
import tarfile
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from robocasa_lerobot import gl
from robocasa_lerobot.files import write_text
from robocasa_lerobot.provenance import git_commit, utc_now

REPOSITORY = Path(__file__).parents[1]
RESULTS = REPOSITORY / "benchmarks" / "results"
# Variables that change how fast something runs; recorded where they are set.
VARIABLES = ("MUJOCO_GL", "MUJOCO_EGL_DEVICE_ID", "OMP_NUM_THREADS", "LP_NUM_THREADS", "NUMBA_NUM_THREADS")
QUIET_SHARE = 0.05  # of all cores; more by others than this spoils a measurement


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory, system, and the variables that matter; no names or paths."""
    facts = {
        "cpu": _first_value(Path("/proc/cpuinfo"), "model name") or platform.processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gib": _memory_gib(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }
    return {**facts, "variables": {name: os.environ[name] for name in VARIABLES if name in os.environ}}


def renderers(backend: str) -> str:
    """What draws our pictures, and the OpenGL that draws a peer's."""
    found = gl.probe(backend).renderer if backend in gl.HEADLESS_BACKENDS else backend
    return f"{gl.OWN_RENDERER}; OpenGL: {found}" if gl.draws_on_cpu() else str(found)


def versions(*packages: str) -> dict[str, str]:
    """Installed versions by package name, and the commit of this checkout (with "+changes" where files differ)."""
    found = {name: importlib.metadata.version(name) for name in packages}
    return {**found, "commit": _commit()}


def spread(values: Sequence[float]) -> dict[str, Any]:
    """Median, extremes and all values of repeated measurements."""
    return {"median": statistics.median(values), "min": min(values), "max": max(values), "values": list(values)}


def busy_share(seconds: float = 0.3) -> float | None:
    """Share (0..1) of all cores that was busy during the next `seconds`; None where the system does not say.

    Called while the benchmark itself waits, it is what others take. Time that the host gave to other guests counts.
    """
    before = _cpu_times()
    if before is None:
        return None
    time.sleep(seconds)
    after = _cpu_times()
    assert after is not None
    total, idle = after[0] - before[0], after[1] - before[1]
    return 0.0 if total <= 0 else 1.0 - idle / total


def unpack(commit: str, folder: Path, *paths: str) -> Path:
    """Lay the files of a commit of ours into a folder, all or those below some paths."""
    command = ["git", "archive", commit, *paths]
    archive = subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder, filter="data")
    return folder


def chosen_kinds(parser: argparse.ArgumentParser, text: str, known: Sequence[str]) -> list[str]:
    """Kinds of work out of a comma-separated list; one that there is not ends the program."""
    kinds = text.split(",")
    if unknown := set(kinds) - set(known):
        parser.error(f"no kind {', '.join(sorted(unknown))}: there are {', '.join(known)}")
    return kinds


def keep_samples_apart(parser: argparse.ArgumentParser, every: int, out: Path, whole: Path) -> None:
    """End the program where the result of every n-th kitchen alone would replace that of all."""
    if every > 1 and out == whole:
        parser.error("a sample does not replace the result of all kitchens: give --out")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Text in columns; the first one is aligned to the left, numbers to the right."""
    lines = [list(header), *(list(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(header))]
    text = ["  ".join([line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
            for line in lines]  # fmt: skip
    return "\n".join(line.rstrip() for line in (text[0], "-" * len(text[0]), *text[1:]))


def write_result(path: Path, name: str, body: dict[str, Any]) -> None:
    """Write a benchmark's result as JSON: written aside, then renamed, so that no reader meets half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps({"benchmark": name, "date": utc_now(), **body}, indent=1) + "\n")


def _commit() -> str:
    # Results written by an earlier benchmark are no change of what is measured.
    commit = git_commit("benchmarks/results")
    return "unknown" if commit is None else commit[:12] + ("+changes" if commit.endswith("-dirty") else "")


def _cpu_times() -> tuple[int, int] | None:
    """Total and idle ticks of all cores since the start."""
    path = Path("/proc/stat")
    if not path.exists():
        return None
    # user nice system idle iowait irq softirq steal (guest times are already part of user)
    ticks = [int(word) for word in path.read_text().splitlines()[0].split()[1:9]]
    return sum(ticks), ticks[3] + ticks[4]


def _memory_gib() -> float | None:
    text = _first_value(Path("/proc/meminfo"), "MemTotal")
    return round(int(text.split()[0]) / 1024**2, 1) if text else None


def _first_value(path: Path, key: str) -> str:
    if path.exists():
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith(key):
                return line.partition(":")[2].strip()
    return ""
