"""What gives a trial its actions: one interface for policies of this process, of another one, and reference ones."""

from __future__ import annotations

import collections
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.policies.common.look_back import LookBack

Observation = dict[str, Any]


@dataclass
class ActingTime:
    """Seconds of wall time in `act` since the start of the trial: computing, and waiting for others."""

    policy: float = 0.0
    waiting: float = 0.0


class Actor(Protocol):
    """A policy as a trial sees it; one trial at a time."""

    time: ActingTime

    def reset(self, seed: int, env: Any) -> None:
        """Forget the last trial; `seed` fixes all sampling noise of the next one, `env` (unwrapped) has been reset."""

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The action of shape (12,) in stored order for an observation of the env."""

    def sees(self, step: int) -> bool:
        """Whether the pictures of the observation that action `step` (from 0) answers to can matter."""


@dataclass(frozen=True)
class ChunkShape:
    """How often a chunked policy looks: `executed` actions of each chunk, from the observations at `offsets`.

    Offsets are control steps, ascending up to 0, the newest; before the trial's start its first observation counts, as
    in training.
    """

    executed: int
    offsets: tuple[int, ...] = (0,)

    @property
    def history(self) -> int:
        """Number of observations of a request."""
        return len(self.offsets)


@dataclass(frozen=True)
class ChunkRequest:
    """What a chunk of actions is computed from, and nothing else: a chunk is a function of its request.

    `observations` are those at the policy's offsets, oldest first; `seed` and `number` (of the chunk in its trial) fix
    its noise.
    """

    label: str
    observations: tuple[Observation, ...]
    instruction: str
    seed: int
    number: int


@dataclass(frozen=True)
class ChunkReply:
    """Actions (executed, 12) float32 in stored order, and this request's share of the computing time, seconds."""

    actions: NDArray[np.float32]
    seconds: float


def chunk_seed(seed: int, number: int) -> int:
    """Seed of the sampling noise of a trial's chunk `number`."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1, dtype=np.uint64)[0] >> 1)


class ChunkActor:
    """Executes action chunks; the queue and the history of observations are the trial's own.

    Args:
        label: of the policy.
        shape: see `ChunkShape`.
        predict: gives the chunk of a request, wherever it is computed.
    """

    def __init__(self, label: str, shape: ChunkShape, predict: Callable[[ChunkRequest], ChunkReply]) -> None:
        self._label, self._shape, self._predict = label, shape, predict
        self.reset(0, None)

    def reset(self, seed: int, env: Any) -> None:
        """Empty the queue."""
        self.time = ActingTime()
        self._seed, self._number, self._step = seed, 0, 0
        self._queue: collections.deque[NDArray[np.float32]] = collections.deque()
        self._back: LookBack[Observation] = LookBack(self._shape.offsets, self._shape.executed)

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The next action of the chunk, or the first of a new one."""
        step = self._step
        self._step += 1
        self._back.note(step, observation)
        if not self._queue:
            request = ChunkRequest(self._label, self._back.at(step), instruction, self._seed, self._number)
            started = time.perf_counter()
            reply = self._predict(request)
            self.time.policy += reply.seconds
            self.time.waiting += max(0.0, time.perf_counter() - started - reply.seconds)
            self._number += 1
            self._queue.extend(reply.actions)
        return self._queue.popleft()

    def sees(self, step: int) -> bool:
        """Whether a chunk that is predicted at step `step` or later looks at it."""
        return self._back.sees(step)
