"""A command that is killed again and again, and begun again until it ends by itself."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence

SHORTEST_S, LONGEST_S = 3.5, 9.0


def run_killed(words: Sequence[str], rng: random.Random, at_least: int = 1, deadline_s: float = 600.0) -> int:
    """How often `robocasa-lerobot WORDS --workers K` was killed before it ended well.

    Each run has one to three workers, and is killed after a time that is drawn: its whole group, or the first process
    alone. While fewer than `at_least` kills have come, the time is short; afterwards it is longer each time, so that a
    slow machine gets on as well.
    """
    kills, deadline = 0, time.monotonic() + deadline_s
    while time.monotonic() < deadline:
        workers = str(rng.choice((1, 2, 3)))
        process = subprocess.Popen(
            [sys.executable, "-m", "robocasa_lerobot.cli", *words, "--workers", workers],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            process.wait(rng.uniform(SHORTEST_S, LONGEST_S) * (1 + 0.2 * max(0, kills - at_least)))
        except subprocess.TimeoutExpired:
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
