"""Independent jobs in several processes, none of which stays behind."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import psutil
import pytest

from robocasa_lerobot.errors import WorkerDiedError
from robocasa_lerobot.jobs.as_completed import as_they_end

ENDLESS = "import time; from robocasa_lerobot.jobs.as_completed import as_they_end; "
ENDLESS += "list(as_they_end(time.sleep, [(600,)] * 8, 2))"


def test_nothing_to_do_is_done_at_once() -> None:
    assert list(as_they_end(abs, [], 4)) == []
    assert sorted(as_they_end(abs, [(-1,), (2,), (-3,)], 2)) == [1, 2, 3]


def test_a_worker_that_dies_is_told_in_words() -> None:
    with pytest.raises(WorkerDiedError, match="try fewer workers"):
        list(as_they_end(os._exit, [(1,)] * 3, 2))


def test_workers_end_with_the_process_that_started_them() -> None:
    with subprocess.Popen([sys.executable, "-c", ENDLESS]) as process:
        others: list[psutil.Process] = []
        deadline = time.monotonic() + 60
        while len(others) < 4 and time.monotonic() < deadline:  # the server that forks them, a tracker and two workers
            time.sleep(0.1)
            others = psutil.Process(process.pid).children(recursive=True)
        assert len(others) >= 4
        time.sleep(1.0)
        process.kill()
    _, alive = psutil.wait_procs(others, timeout=30)
    assert not alive
