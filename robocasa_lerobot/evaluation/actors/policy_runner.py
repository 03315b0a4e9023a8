"""From a policy's source to what acts in a trial of this process."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import ActingTime, Actor, ChunkActor, Observation
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.actors.reference_policies import (
    DemonstratorPolicy,
    RandomPolicy,
    ReplayPolicy,
    ZeroPolicy,
)
from robocasa_lerobot.evaluation.actors.remote_actor import RemoteActor


class StepPolicy:
    """A checkpoint whose policy keeps queues of its own, run as `lerobot-eval` runs it: one call for each step.

    Order: `preprocess_observation` -> task -> preprocessor -> `select_action` -> postprocessor. The process's torch
    generator is seeded at each reset: a worker runs one trial at a time, so that a trial draws the same noise
    whatever ran before it.
    """

    def __init__(self, loaded: LoadedCheckpoint) -> None:
        self._loaded = loaded
        self.time = ActingTime()

    def reset(self, seed: int, env: Any) -> None:
        """Clear the policy's queues and seed its sampling noise."""
        import torch

        torch.manual_seed(seed)
        self.time = ActingTime()
        for part in (self._loaded.policy, self._loaded.pre, self._loaded.post):
            part.reset()

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The policy's next action."""
        import torch
        from lerobot.envs.utils import preprocess_observation

        started = time.perf_counter()
        batch = preprocess_observation(observation)
        batch["task"] = [instruction]
        batch = self._loaded.pre(batch)
        with torch.inference_mode():
            action = self._loaded.post(self._loaded.policy.select_action(batch))
        self.time.policy += time.perf_counter() - started
        return np.asarray(action.to("cpu").numpy()[0], dtype=np.float32)

    def sees(self, step: int) -> bool:
        """Always, since nothing is known about its queues."""
        return True


def load_actor(
    source: PolicySource,
    device: str,
    executed_steps: int | None,
    width: int = 1,
    runtime: str = "onnx",
    waiting: Callable[[], None] = lambda: None,
) -> Actor:
    """What acts for a policy source in this process; `waiting` is called while a policy behind a socket computes.

    Raises:
        UserError: see `LoadedCheckpoint` and `ChunkPolicy`.
        LostError: a policy behind a socket cannot be reached.
    """
    if source.remote is not None:
        return RemoteActor(source.label, source.remote, waiting)
    if source.is_reference:
        return load_reference(source)
    loaded = LoadedCheckpoint(source, device, executed_steps, runtime)
    if not ChunkPolicy.serves(loaded):
        return StepPolicy(loaded)
    policy = ChunkPolicy(loaded, width)
    return ChunkActor(source.label, policy.shape, lambda request: policy.predict([request])[0])


def load_reference(source: PolicySource) -> Actor:
    """A policy that needs no checkpoint."""
    if source.type == "replay":
        return ReplayPolicy(Path(source.path.partition(":")[2]))
    made: dict[str, type[ZeroPolicy | RandomPolicy | DemonstratorPolicy]] = {
        "zero": ZeroPolicy,
        "random": RandomPolicy,
        "demonstrator": DemonstratorPolicy,
    }
    return made[source.type]()


def pick_device(device: str) -> str:
    """A device as torch calls it; `auto` is cuda where there is one, else cpu.

    Raises:
        UserError: a device that this machine does not have.
    """
    import torch

    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if device == "auto":
        return "cuda" if gpus else "cpu"
    there = ["cpu"]
    if gpus:
        there += ["cuda", *(f"cuda:{index}" for index in range(gpus))]
    if torch.backends.mps.is_available():
        there.append("mps")
    if device not in there:  # names are not read: to torch cuda:256 is cuda:0
        raise UserError(f"device {device!r} is not there: torch sees {', '.join(there)}. Choose one of them, or auto.")
    return device
