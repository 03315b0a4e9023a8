"""The converter's command as a user starts it: seconds from start to end, and peak memory of all its processes."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any

import psutil
from workers import WorkerError

SAMPLE_S = 0.02


def run_command(arguments: Sequence[str]) -> dict[str, Any]:
    """Run `robocasa-lerobot ARGUMENTS`.

    Returns:
        `seconds`, start of the interpreter and imports included; `peak_mib`, the largest sum over the process and
        its descendants of what each has in RAM, sampled 50 times a second (a command that is over sooner is not
        measured; pages that forked processes share count once for each of them); `processes`, the most at one time.

    Raises:
        WorkerError: the command failed; the message has its last words.
    """
    command = [sys.executable, "-m", "robocasa_lerobot.cli", *arguments]
    peak, processes = 0.0, 0
    with tempfile.TemporaryFile() as said:
        start = time.perf_counter()
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
        try:
            root = psutil.Process(child.pid)
            while child.poll() is None:
                resident = _resident(root)
                peak, processes = max(peak, sum(resident) / 2**20), max(processes, len(resident))
                time.sleep(SAMPLE_S)
        finally:
            if child.poll() is None:
                child.kill()
                child.wait()
        seconds = time.perf_counter() - start
        if child.returncode != 0:
            said.seek(0)
            words = said.read().decode(errors="replace").strip().splitlines()
            raise WorkerError(f"{' '.join(arguments)} ended with status {child.returncode}:\n" + "\n".join(words[-15:]))
    return {"seconds": seconds, "peak_mib": peak, "processes": processes}


def _resident(root: psutil.Process) -> list[int]:
    sizes = []
    try:
        for process in (root, *root.children(recursive=True)):
            try:
                sizes.append(process.memory_info().rss)
            except psutil.NoSuchProcess:
                continue
    except psutil.NoSuchProcess:
        pass
    return sizes
