"""A command that is killed again and again, and begun again until it ends by itself."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

POLL_S, STARTING_S, ATTEMPT_S = 0.05, 4.0, 0.6
MOST_ATTEMPTS = 2  # of a run while fewer kills have come than are wanted
FILE = 100  # attempts that a finished file stands for, whose own are cleared away


def run_killed(
    words: Sequence[str], out: Path, rng: random.Random, at_least: int = 1, deadline_s: float = 600.0
) -> int:
    """How often `robocasa-lerobot WORDS --workers K --out OUT` was killed before it ended well.

    Each run has one to three workers, and is killed while it starts, or a moment after it has made as many attempts as
    are drawn: its whole group, or the first process alone. That goes by attempts, so that a fast machine is not done
    before, nor a slow one never; once `at_least` kills have come, each run may make more.

    Args:
        words: of the command, which leaves a file of each attempt in `OUT/.TASK.parts`.
        out: its folder.
        rng: of the draws.
        at_least: kills; fewer are an error.
        deadline_s: of all runs.
    """
    kills, deadline = 0, time.monotonic() + deadline_s
    while time.monotonic() < deadline:
        workers = str(rng.choice((1, 2, 3)))
        process = subprocess.Popen(
            [sys.executable, "-m", "robocasa_lerobot.cli", *words, "--workers", workers, "--out", str(out)],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        more = rng.randint(0, MOST_ATTEMPTS) + max(0, kills - at_least)
        wanted = _attempts(out) + more
        while process.poll() is None and _attempts(out) < wanted:
            time.sleep(POLL_S)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(rng.uniform(0.0, ATTEMPT_S if more else STARTING_S))
        if process.poll() is None:
            kills += 1
            if rng.random() < 0.5:
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
            process.wait()
            continue
        assert process.returncode == 0
        assert kills >= at_least, f"ended after {kills} kills of {at_least}"
        return kills
    raise AssertionError(f"not done after {deadline_s:g} s and {kills} kills")


def _attempts(out: Path) -> int:
    """How many have ended."""
    return len(list(out.glob(".*.parts/[0-9]*.*"))) + FILE * len(list(out.glob("*.hdf5")))
