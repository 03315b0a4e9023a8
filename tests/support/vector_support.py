"""A small env for tests of the vector env: no physics and no rendering, but faults on request.

The observation holds the episode's seed and step, so that a test knows which episode it looks at. An episode ends
with success at step `length`. A fault is written `what@where`: "raise", "kill", "exit", "crash" (a segmentation fault)
or "hang"; where is "make", "reset" (the second one), "step" (the second one) or "call".
"""

import ctypes
import gc
import multiprocessing
import os
import signal
import time

import gymnasium
import numpy as np
import pytest

from robocasa_lerobot import gl

STILL = np.zeros((2, 2), np.float32)  # an action for two of these envs


@pytest.fixture(autouse=True)
def clean_workers(monkeypatch):
    """Most of these envs do not render; and whatever happens, no worker outlives its test."""
    monkeypatch.setenv(gl.VARIABLE, os.environ.get(gl.VARIABLE) or "egl")
    monkeypatch.delenv(gl.DEVICE_VARIABLE, raising=False)
    before = set(multiprocessing.active_children())
    yield
    gc.collect()
    left = set(multiprocessing.active_children()) - before
    for process in left:
        process.kill()
    assert not left


class FaultyEnv(gymnasium.Env):
    def __init__(self, task="Count", length=3, fault="", renderer=None):
        self.task, self.length, self._fault = task, length, fault
        self._resets, self._renderer = 0, renderer
        self.observation_space = gymnasium.spaces.Dict(
            {
                "pixels": gymnasium.spaces.Box(0, 255, (4, 4, 3), np.uint8),
                "agent_pos": gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float64),
            }
        )
        self.action_space = gymnasium.spaces.Box(-1, 1, (2,), np.float32)
        self._maybe_fail("make")

    def next_seed(self):
        generator = np.random.Generator(np.random.PCG64())
        generator.bit_generator.state = self.np_random.bit_generator.state
        return int(generator.integers(1000))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._resets += 1
        if self._renderer is not None:
            gl._used_renderer = self._renderer  # as if this process had rendered
        self._seed = int(self.np_random.integers(1000)) if seed is None else seed
        if self._resets == 2:
            self._maybe_fail("reset")
        self._step = 0
        return self._observe(), self._info()

    def step(self, action):
        self._step += 1
        if self._step == 2:
            self._maybe_fail("step")
        success = self._step >= self.length
        return self._observe(), float(success), success, False, self._info()

    def variable(self, name):
        return os.environ.get(name)

    def misbehave(self):
        self._maybe_fail("call")
        return self._seed

    def unsendable(self):
        return (step for step in range(self._step))

    def _observe(self):
        picture = np.full((4, 4, 3), self._step, np.uint8)
        return {"pixels": picture, "agent_pos": np.array([self._seed, self._step], np.float64)}

    def _info(self):
        success = self._step >= self.length
        terms = {f"{self.task} done": success}
        return {"success": success, "success_terms": terms, "instruction": f"Count {self.task}", "seed": self._seed}

    def _maybe_fail(self, where):
        what, _, place = self._fault.partition("@")
        if place != where:
            return
        if what == "raise":
            raise ArithmeticError("it does not add up")
        if what == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if what == "exit":
            os._exit(7)
        if what == "crash":
            ctypes.string_at(0)
        if what == "hang":
            hang_here()


def hang_here():
    time.sleep(3600)


def two_workers(fault):
    """Two factories; env 1 has the fault."""
    return [lambda: FaultyEnv("Fine"), lambda: FaultyEnv("Faulty", fault=fault)]


if __name__ == "__main__":  # a process that a test kills, whose workers must then end
    from robocasa_lerobot.envs.vector.kitchens import make_vector_env

    envs = make_vector_env([FaultyEnv, lambda: FaultyEnv(fault="hang@step")])
    envs.reset(seed=1)
    print(*[process.pid for process in envs.processes], flush=True)
    envs.step(np.zeros((2, 2)))
    envs.step(np.zeros((2, 2)))
