"""The measuring half of a simulator benchmark: runs one env in this process and answers commands from a pipe.

Used by the program of each simulator, so that all are measured by the same lines. It knows none of them: besides the
standard library only NumPy and MuJoCo, which every program's environment has.

A command is a line of JSON on stdin, `{"command": name, ...}`; the answer is a line of JSON on stdout. Whatever a
library prints goes to stderr.
"""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TextIO

import mujoco
import numpy as np
from numpy.typing import NDArray

ACTION_SIZE = 12
ARM_BASE_TORSO = 0.3  # commands of arm, base and torso are drawn from +- this; 1 is full speed
EPISODE_STEPS = 200  # control steps between two resets, 10 s of simulated time
WARM_UP_STEPS = 5  # after every reset, not counted
ROBOT_PREFIXES = ("robot0_", "gripper0_", "mobilebase0_")


class Simulator(Protocol):
    """One simulator's env, as the benchmark sees it."""

    def make(self, cameras: bool) -> None:
        """Construct the env, with three cameras or with none."""

    def reset(self, seed: int, same_scene: bool) -> None:
        """Begin an episode: in a new scene, or again in the scene that is there."""

    def step(self, action: NDArray[np.float64]) -> None:
        """Carry out one action (12,) for one control step, observations included."""

    def model(self) -> Any:
        """The `mujoco.MjModel` that is running."""

    def describe(self) -> dict[str, Any]:
        """Versions, cameras and settings, for the record."""

    def split(self, seed: int, steps: int) -> dict[str, float]:
        """Seconds per control step of each part of the work; only where the simulator can tell."""


def episode_actions(seed: int, steps: int, standing: bool = False) -> NDArray[np.float64]:
    """Small random actions (steps, 12) of an episode, in robosuite's order; the same for every simulator.

    With `standing` base and torso are not commanded, as in most of what people have recorded.

    End-effector position 3 and rotation 3, gripper, base 3, torso, base mode. Gripper and mode are binary; the mode
    stays at -1 (the arm's command is added to the pose that it has reached), as in the recorded demonstrations.
    """
    rng = np.random.default_rng(seed)
    actions = rng.uniform(-ARM_BASE_TORSO, ARM_BASE_TORSO, (steps, ACTION_SIZE))
    actions[:, 6] = np.where(actions[:, 6] > 0, 1.0, -1.0)
    actions[:, 11] = -1.0
    if standing:
        actions[:, 7:11] = 0.0
    return actions


class Loop:
    """Carries out the commands on one simulator."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._seed = 0
        self._standing = False

    def hello(self) -> dict[str, Any]:
        """An answer, which says that everything is imported."""
        return {}

    def make(self, cameras: bool, seed: int) -> dict[str, Any]:
        """Construct the env and reset it once: seconds of both, and the process's memory before and after."""
        before = resident_mib()
        start = time.perf_counter()
        self._simulator.make(cameras)
        constructed = time.perf_counter()
        self._reset(seed, same_scene=False)
        done = time.perf_counter()
        self._steps(WARM_UP_STEPS)
        return {
            "construct_s": constructed - start,
            "first_reset_s": done - constructed,
            "resident_after_import_mib": before,
            "resident_mib": resident_mib(),
            "model": describe_model(self._simulator.model()),
            **self._simulator.describe(),
        }

    def resets(self, count: int, seed: int, same_scene: bool) -> dict[str, Any]:
        """Seconds of each of `count` resets, with a few steps between them, and by how much each grew the process."""
        self._reset(seed, same_scene=False)
        before = resident_mib()
        seconds = []
        for i in range(count):
            self._steps(WARM_UP_STEPS)
            start = time.perf_counter()
            self._reset(seed if same_scene else seed + 1 + i, same_scene)
            seconds.append(time.perf_counter() - start)
        return {"seconds": seconds, "growth_mib": (resident_mib() - before) / count}

    def new_scene(self, seed: int) -> dict[str, Any]:
        """Seconds of one reset to a new scene."""
        start = time.perf_counter()
        self._reset(seed, same_scene=False)
        return {"seconds": time.perf_counter() - start}

    def prepare(self, seed: int, standing: bool = False) -> dict[str, Any]:
        """Begin the first episode of a run; with `standing` base and torso are not commanded in it."""
        self._standing = standing
        self._reset(seed, same_scene=False)
        self._steps(WARM_UP_STEPS)
        return {}

    def run(self, at: float, seconds: float) -> dict[str, Any]:
        """Step from the instant `at` (of the monotonic clock, which all processes share) for `seconds`.

        Episodes of 200 steps; their resets and warm-up steps belong to the time in which this process is busy, but
        neither to the steps nor to the seconds that are counted.
        """
        while (wait := at - time.perf_counter()) > 0:
            time.sleep(min(wait, 0.05))
        steps, counted, episodes, in_episode = 0, 0.0, 1, 0
        actions = episode_actions(self._seed, EPISODE_STEPS, self._standing)
        while True:
            start = time.perf_counter()
            self._simulator.step(actions[in_episode])
            now = time.perf_counter()
            steps, counted, in_episode = steps + 1, counted + (now - start), in_episode + 1
            if now >= at + seconds:
                break
            if in_episode == EPISODE_STEPS:
                self.prepare(self._seed + 1, self._standing)
                episodes, in_episode = episodes + 1, 0
                actions = episode_actions(self._seed, EPISODE_STEPS, self._standing)
        return {"steps": steps, "seconds": counted, "episodes": episodes}

    def split(self, seed: int, steps: int) -> dict[str, Any]:
        """Where the simulator's time goes, by its own account."""
        return dict(self._simulator.split(seed, steps))

    def _reset(self, seed: int, same_scene: bool) -> None:
        self._seed = seed
        self._simulator.reset(seed, same_scene)

    def _steps(self, count: int) -> None:
        for action in episode_actions(self._seed, count, self._standing):
            self._simulator.step(action)


def describe_model(model: Any) -> dict[str, int]:
    """Sizes of a model, and its doors, drawers and loose objects, counted by the joints that are not the robot's."""
    counts = {"doors": 0, "drawers": 0, "other_hinges": 0, "objects": 0}
    for i in range(model.njnt):
        joint = model.joint(i)
        if joint.name.startswith(ROBOT_PREFIXES):
            continue
        kind, body = int(joint.type[0]), model.body(int(joint.bodyid[0])).name
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            counts["objects"] += 1
        elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
            counts["drawers"] += 1
        else:
            counts["doors" if body.endswith("door") else "other_hinges"] += 1
    return {"geoms": int(model.ngeom), "dofs": int(model.nv), "bodies": int(model.nbody), **counts}


def resident_mib() -> float:
    """Memory of this process that is in RAM, MiB."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    import resource  # no /proc: the peak, which macOS gives in bytes

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024**2 if sys.platform == "darwin" else 1024)


def serve(simulator: Simulator) -> None:
    """Answer the commands of a simulator's loop until stdin ends."""
    loop = Loop(simulator)
    answer_commands(loop.hello, loop.make, loop.resets, loop.new_scene, loop.prepare, loop.run, loop.split)


def answer_commands(*commands: Callable[..., dict[str, Any]]) -> None:
    """Answer commands, which have the functions' names, until stdin ends; an error is answered and ends the process."""
    replies = _take_stdout()
    by_name = {command.__name__: command for command in commands}
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer: dict[str, Any] = by_name[request.pop("command")](**request)
        except Exception:
            answer = {"error": traceback.format_exc()}
        replies.write(json.dumps(answer) + "\n")
        replies.flush()
        if "error" in answer:
            raise SystemExit(1)


def _take_stdout() -> TextIO:
    """Stdout for the replies alone: prints, also those of C libraries, go to stderr from now on."""
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return replies
