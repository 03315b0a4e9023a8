"""A policy behind a socket as a trial sees it."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkReply, ChunkRequest, ChunkShape
from robocasa_lerobot.evaluation.remote.client import TOKEN_VARIABLE, Waiting
from robocasa_lerobot.evaluation.remote.connect import connect
from robocasa_lerobot.evaluation.remote.introduction import RemotePolicy
from robocasa_lerobot.evaluation.remote.translation import actions_of, request_of


class RemoteActor(ChunkActor):
    """Chunks come from a server, over a connection of this actor's own.

    Args:
        label: of the policy.
        policy: address and key map.
        waiting: called every now and then while the server computes.

    Raises:
        LostError: the server cannot be reached.
    """

    def __init__(self, label: str, policy: RemotePolicy, waiting: Waiting) -> None:
        self._policy, self._key_map = policy, policy.key_map
        patience = replace(policy.timeouts, introduction=policy.timeouts.first_answer)  # it may compile for another
        self._client = connect(policy.address, patience, waiting, os.environ.get(TOKEN_VARIABLE))
        shape = ChunkShape(executed=self._key_map.executed_steps, offsets=self._key_map.offsets)
        super().__init__(label, shape, self._ask)

    def reset(self, seed: int, env: Any) -> None:
        """Empty the queue, and tell the server that a trial begins.

        Raises:
            RemoteError: the server cannot be told.
        """
        super().reset(seed, env)
        if env is not None:  # None: the constructor's own
            self._client.reset(self._key_map.reset)

    def close(self) -> None:
        """End the connection."""
        self._client.close()

    def _ask(self, request: ChunkRequest) -> ChunkReply:
        started = time.perf_counter()
        message = request_of(self._key_map, request.observations, request.instruction, request.seed, request.number)
        answer = self._client.infer(message)
        actions = actions_of(self._key_map, answer)[: self._key_map.executed_steps]
        elapsed = time.perf_counter() - started
        return ChunkReply(actions, min(elapsed, _computing_seconds(answer, elapsed)))


def _computing_seconds(answer: Mapping[str, Any], elapsed: float) -> float:
    """What the server says that it computed, as openpi's servers do; else all the time that passed."""
    for name in ("server_timing", "policy_timing"):
        timing = answer.get(name)
        milliseconds = timing.get("infer_ms") if isinstance(timing, Mapping) else None
        if isinstance(milliseconds, int | float) and milliseconds >= 0:
            return milliseconds / 1000
    return elapsed
