"""Adapters for tests of foreign envs: one that needs nothing but NumPy, and one that misbehaves.

Faults are asked for by `options`: `says` prints to the standard output; `nonsense` writes into the pipe of answers.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

TASKS = ["Slide", "Push"]


def STARTS(options):  # noqa: N802
    return {"Slide": 3} if options.get("fixed") else {}


class Space:
    def __init__(self, low, high):
        self.low, self.high = np.asarray(low, np.float32), np.asarray(high, np.float32)
        self.shape = self.low.shape


class PlainEnv:
    """A place on a line is moved by the first of two numbers; nothing but NumPy is needed."""

    metadata = {"render_fps": 7}  # noqa: RUF012

    def __init__(self, task, horizon=None, fixed=False, says="", nonsense="", pictures=True, note=None):
        self.task, self.horizon = task, horizon or 20
        self.task_description = task.lower() + " it"
        self.action_space = Space([0.0, -2.0], [4.0, 2.0])
        self._says, self._nonsense, self._pictures, self._note = says, nonsense, pictures, note
        if note:
            (Path(note) / str(os.getpid())).touch()

    def reset(self, seed=None):
        self._place = float(np.random.RandomState(seed).uniform(-1, 1))
        self._steps = 0
        if self._says:
            print(self._says, flush=True)
        return self._seen(), {}

    def step(self, action):
        assert action.dtype == np.float32
        self._place += 0.1 * float(action[1])
        self._steps += 1
        if self._nonsense and self._steps == 2:
            os.write(int(sys.argv[2]), self._nonsense.encode())
        if self._note:
            time.sleep(0.01)
        done = self._place > 1
        return self._seen(), 0.0, done, self._steps >= self.horizon, {"is_success": done}

    def expert_action(self):
        return np.array([0.0, 2.0])

    def close(self):
        pass

    def _seen(self):
        seen = {"agent_pos": np.array([self._place]), "more": {"steps": np.int64(self._steps)}}
        if self._pictures:
            seen["pixels"] = np.full((32, 40, 3), 5 * self._steps, np.uint8)
        return seen


class AnySize(PlainEnv):
    def __init__(self, task, image_size=None, **options):
        super().__init__(task, **options)


class WithoutExpert(PlainEnv):
    expert_action = None


class GreyEnv(PlainEnv):
    def _seen(self):
        return {"pixels": {"top": np.zeros((32, 32), np.uint8)}, "agent_pos": np.zeros(2)}


def broken(task, **options):
    raise FileNotFoundError("no meshes of " + task)
