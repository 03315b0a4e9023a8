"""What the servers of all protocols share: the policy, its clients' sessions, and a request's way to its actions."""

from __future__ import annotations

import asyncio
import dataclasses
import itertools
import time
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ChunkRequest
from robocasa_lerobot.serving.compute import ComputeThread
from robocasa_lerobot.serving.observations import Asked, Wanted, read_observation
from robocasa_lerobot.serving.policy import ServedPolicy, Work
from robocasa_lerobot.serving.request import Session, whole_number


@dataclass(frozen=True)
class Reply:
    """Actions (executed, 12) float32 in stored order, what they answer to, and wall seconds until they were there."""

    actions: NDArray[np.float32]
    asked: Asked
    number: int
    seconds: float

    def flat(self) -> NDArray[np.float32]:
        """The actions in the order that the client's names stand for."""
        return self.actions if self.asked.stored_order else contract.stored_to_hdf5(self.actions)


class Host:
    """A policy and the sessions of its clients.

    Args:
        policy: to be served.
        seed: fixes the noise of sessions whose clients give no seed.
        resize: scale pictures of another size than the policy's.
        repeat_history: one observation may stand for all of the policy's history.
    """

    def __init__(self, policy: ServedPolicy, seed: int = 0, resize: bool = False, repeat_history: bool = False) -> None:
        self.served = policy.served
        self._compute = ComputeThread(policy)
        self._seed, self._sessions = seed, itertools.count()
        served = self.served
        self.wanted = Wanted(served.cameras, served.image_size, served.offsets, resize, repeat_history)
        # Of a client that sends every step: the history is put together here.
        self.wanted_now = dataclasses.replace(self.wanted, offsets=(0,))

    def session(self) -> Session:
        """A new client's."""
        return Session(self._seed, next(self._sessions))

    async def answer(self, session: Session, message: Any, options: Mapping[Any, Any]) -> Reply:
        """Actions for an observation; `options` may hold `seed`, `number` and `reset`.

        Raises:
            RequestError: the client's mistake; anything else is the policy's.
        """
        began = time.perf_counter()
        asked = await asyncio.to_thread(read_observation, message, self.wanted)
        seed, number = whole_number(options, "seed"), whole_number(options, "number")
        if options.get("reset"):
            session.begin(seed)
        seed, number = session.next(seed, number)
        request = ChunkRequest(self.served.source.label, asked.observations, asked.instruction, seed, number)
        actions = await asyncio.wrap_future(self.submit(session, request))
        return Reply(actions, asked, number, time.perf_counter() - began)

    def submit(self, session: Session, request: ChunkRequest) -> Future[NDArray[np.float32]]:
        """Actions (executed, 12) in stored order of a request, when they are computed."""
        return self._compute.submit(Work(session, request))

    def close(self) -> bool:
        """End the computing; False where it does not end."""
        return self._compute.close()
