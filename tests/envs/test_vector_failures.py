"""Every failure of a vector env's worker is reported with its place, and leaves no process behind."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vector_support
from gymnasium.error import ClosedEnvironmentError
from vector_support import STILL, FaultyEnv, clean_workers, two_workers  # noqa: F401 (a fixture)

from robocasa_lerobot.envs.vector import env as vector_env
from robocasa_lerobot.envs.vector.kitchens import WorkerError, make_vector_env

IN_STEP = ("step", 21, 2)
NEXT_SEED = int(np.random.default_rng(21).integers(1000))
FAULTS: dict[str, tuple[tuple[str, int | None, int], str, str]] = {
    "raise@make": (("start-up", None, 0), "ArithmeticError: it does not add up", "_maybe_fail"),
    "raise@step": (IN_STEP, "ArithmeticError: it does not add up", "_maybe_fail"),
    "raise@reset": (("autoreset", NEXT_SEED, 0), "ArithmeticError: it does not add up", "_maybe_fail"),
    "kill@make": (("start-up", None, 0), "SIGKILL", ""),
    "kill@step": (IN_STEP, "SIGKILL, perhaps for want of memory", ""),
    "kill@reset": (("autoreset", NEXT_SEED, 0), "SIGKILL", ""),
    "kill@call": (("call", 21, 0), "SIGKILL", ""),
    "exit@step": (IN_STEP, "exit status 7", ""),
    "crash@step": (IN_STEP, "SIGSEGV", "string_at"),
    "hang@step": (IN_STEP, "gave no answer for 2 s", "hang_here"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_workers_failure_is_reported_and_the_others_end(fault: str) -> None:
    progress, message, traceback = FAULTS[fault]
    made: list[Any] = []

    def use() -> None:
        made.append(make_vector_env(two_workers(fault), timeout_seconds=2 if fault.startswith("hang") else 60))
        made[0].reset(seed=20)
        if fault.endswith("call"):
            made[0].call("misbehave")
        for _ in range(6):
            made[0].step(STILL)

    with pytest.raises(WorkerError) as caught:
        use()
    error = caught.value
    assert error.index == 1
    assert (error.progress.phase, error.progress.seed, error.progress.steps) == progress
    assert message in str(error)
    assert traceback in error.worker_traceback
    assert error.worker_traceback in str(error)
    assert isinstance(error.__cause__, ArithmeticError) == fault.startswith("raise")
    assert bool(made) != fault.endswith("make")
    for envs in made:
        assert error.task == "Faulty"
        assert envs.closed
        assert envs.processes[0].exitcode == 0  # ended by itself
        assert not envs.processes[1].is_alive()
        with pytest.raises(ClosedEnvironmentError):
            envs.reset(seed=1)
        envs.close()
    assert pickle.loads(pickle.dumps(error)).progress == error.progress


@pytest.mark.parametrize("when", ["idle", "busy"])
def test_a_worker_that_is_killed_from_outside(when: str) -> None:
    with closing(make_vector_env(two_workers("hang@step"))) as envs:
        envs.reset(seed=20)
        envs.step(STILL)
        if when == "busy":
            envs.step_async(STILL)
            time.sleep(0.1)
        os.kill(envs.processes[1].pid, signal.SIGKILL)
        with pytest.raises(WorkerError, match="SIGKILL") as caught:
            envs.step_wait() if when == "busy" else envs.step(STILL)
        assert "gave no answer" not in str(caught.value)  # it did not have to count as hanging first
        assert (caught.value.index, caught.value.progress.seed) == (1, 21)


def test_a_death_is_seen_while_another_worker_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vector_env, "CLOSE_SECONDS", 0.5)
    envs = make_vector_env([partial(FaultyEnv, fault="hang@step"), partial(FaultyEnv, "Dead", fault="kill@step")])
    envs.reset(seed=1)
    envs.step(STILL)
    with pytest.raises(WorkerError, match="task Dead"):
        envs.step(STILL)
    assert [process.exitcode for process in envs.processes] == [-signal.SIGKILL, -signal.SIGKILL]


def test_an_exception_in_a_call_ends_nothing() -> None:
    with closing(make_vector_env(two_workers("raise@call"))) as envs:
        envs.reset(seed=20)
        with pytest.raises(ArithmeticError) as caught:
            envs.call("misbehave")
        assert "env worker 1" in caught.value.__notes__[0]
        with pytest.raises(AttributeError):
            envs.get_attr("no_such_thing")
        with pytest.raises(TypeError, match="cannot pickle 'generator'"):
            envs.call("unsendable")
        assert envs.step(STILL)[0]["agent_pos"].tolist() == [[20, 1], [21, 1]]


def test_workers_end_when_their_parent_is_killed() -> None:
    parent = subprocess.Popen([sys.executable, vector_support.__file__], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    workers = [int(pid) for pid in parent.stdout.readline().split()]
    assert len(workers) == 2
    time.sleep(0.3)  # one idle, one busy
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 30
    while any(map(is_running, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, workers))


def is_running(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):  # gone before, or while it was read
        return False


def test_opening_and_closing_leaves_nothing_behind() -> None:
    def use() -> tuple[int, int, int]:
        with closing(make_vector_env(FaultyEnv, 2)) as envs:
            envs.reset(seed=1)
            envs.step_async(STILL)  # closing does not wait for an answer that nobody takes
        del envs
        gc.collect()
        # What this process maps of it: other processes have files there too.
        shared = Path("/proc/self/maps").read_text().count("/dev/shm/")
        return len(list(Path("/proc/self/fd").iterdir())), shared, len(multiprocessing.active_children())

    first = use()  # starts the fork server
    assert [use() for _ in range(3)] == [first] * 3
