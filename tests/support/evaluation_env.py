"""A small env with the kitchen env's interface, for tests of the evaluation: no physics, no rendering, no torch.

A slider starts at a place drawn from the seed, and the first action component moves it; the goal has two terms.
Faults are asked for through the task's name, so that they reach the worker processes: `Slide+crash` raises at step 2,
`+diverge` as the kitchens do when their physics is lost, `+kill` ends the process, `+hang` sleeps for ever, each only
once, or n times with `+crashxN`; `+slow` takes its time.
`SLIDE_FAULTY_SEEDS` (JSON, seed -> fault) has those that happen in every attempt at a trial; `sigkill` and `nan` too.
"""

import json
import os
import signal
import time
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np

from robocasa_lerobot import contract


class SlideEnv(gymnasium.Env):
    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(self, task, split="target", render_preset="fast", image_size=32, horizon=None):
        self.task, self.split = task, split
        self.horizon = horizon or 30
        self.render_observations = True
        self.task_description = f"{task.split('+')[0].lower()} the block"
        size = (image_size, image_size, 3)
        box = gymnasium.spaces.Box(0, 255, size, np.uint8)
        self.observation_space = gymnasium.spaces.Dict(
            {
                "pixels": gymnasium.spaces.Dict(dict.fromkeys(contract.CAMERAS, box)),
                "agent_pos": gymnasium.spaces.Box(-np.inf, np.inf, (contract.STATE_SIZE,), np.float64),
            }
        )
        self.action_space = gymnasium.spaces.Box(-1, 1, (contract.ACTION_SIZE,), np.float32)
        self._fault = task.partition("+")[2]
        self._pixels = {camera: np.zeros(size, np.uint8) for camera in contract.CAMERAS}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._place = float(self.np_random.uniform(-1, 1))
        self._seed, self._step, self._reached = seed, 0, False
        self._always = json.loads(os.environ.get("SLIDE_FAULTY_SEEDS", "{}")).get(str(seed))
        return self._observe(), {**self._info(), "seed": seed}

    def step(self, action):
        self._step += 1
        if self._fault == "slow":
            time.sleep(0.02)
        elif self._fault and self._step == 2:
            self._fail()
        if self._always and self._step == 2:
            self._happen(self._always)
        self._place += 0.2 * float(action[0])
        self._reached = self._reached or self._place > 0.5
        success = self._place > 0.8
        return self._observe(), float(success), success, self._step >= self.horizon, self._info()

    def _info(self):
        terms = {"far": self._place > 0.5, "very far": self._place > 0.8}
        success = terms["very far"]
        scene = {"layout_id": 1 + (self._seed or 0) % 10, "style_id": 1 + (self._seed or 0) % 10}
        return {
            "success": success,
            "is_success": success,
            "success_terms": terms,
            "instruction": self.task_description,
            "task": self.task,
            "scene": scene,
        }

    def _observe(self):
        if self.render_observations:
            for index, camera in enumerate(contract.CAMERAS):
                picture = np.full_like(self._pixels[camera], 30 + 60 * index)
                column = int(np.clip(np.nan_to_num(self._place + 2) / 4, 0, 0.99) * picture.shape[1])
                picture[:, column] = (255, 128, 0)
                self._pixels[camera] = picture
        state = np.zeros(contract.STATE_SIZE)
        state[0], state[6], state[13] = self._place, 1.0, 1.0
        return {"pixels": dict(self._pixels), "agent_pos": state}

    def _fail(self):
        # SLIDE_FAULTS holds one file for each fault that has happened; the count in the name limits how often.
        kind, _, times = self._fault.partition("x")
        marks = Path(os.environ["SLIDE_FAULTS"])
        if len(list(marks.iterdir())) >= int(times or 1):
            return
        (marks / f"{time.time_ns()}").touch()
        self._happen(kind)

    def _happen(self, kind):
        if kind == "crash":
            raise RuntimeError("the block fell off")
        if kind == "pipe":
            raise BrokenPipeError("the env's own simulator ended")
        if kind == "diverge":
            from robocasa_lerobot.envs.robots.control_step import DivergedError

            raise DivergedError("the simulation diverged at 0.100 s; reset the env.")
        if kind == "kill":
            os._exit(7)
        if kind == "sigkill":
            os.kill(os.getpid(), signal.SIGKILL)
        if kind == "nan":
            self._place = float("nan")
        if kind == "hang":
            time.sleep(3600)


def make_without_horizon(**kwargs):
    env = SlideEnv(**kwargs)
    del env.horizon
    return env


class ExpertSlide(SlideEnv):
    def expert_action(self):
        return np.eye(contract.ACTION_SIZE)[0]


def wrapped(task, **options):
    """The same env as Gymnasium's own `make` gives it, under a wrapper, which hides what Gymnasium does not know."""
    return gymnasium.wrappers.OrderEnforcing(ExpertSlide(task, **options))
