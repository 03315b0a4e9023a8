"""The thread that computes: what waits is answered together, and a policy that serves nobody says so to all."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from typing import Any

import numpy as np
import pytest
from serving_support import observation

from robocasa_lerobot.evaluation.actors.actor import ChunkRequest
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.actors.chunk_policy import BatchingError
from robocasa_lerobot.serving.compute import ComputeThread
from robocasa_lerobot.serving.policy import Answer, Served, ServedPolicy, Work
from robocasa_lerobot.serving.request import Session


class Waiting(ServedPolicy):
    """Answers each request with its number, once it is told to; number 9 shows that batches matter."""

    def __init__(self) -> None:
        served = Served(PolicySource("x", "x", "x", "none"), (), 1, (0,), 1)
        super().__init__(served, None, lambda: pytest.fail("no actor is needed"))
        self.begun, self.go = threading.Event(), threading.Event()
        self.sizes: list[int] = []

    def answer(self, works: Sequence[Work]) -> list[Answer]:
        self.sizes.append(len(works))
        self.begun.set()
        assert self.go.wait(60)
        if any(work.request.number == 9 for work in works):
            raise BatchingError("actions depend on who shares a batch")
        return [np.full((1, 12), work.request.number, np.float32) for work in works]


def work(number: int) -> Work:
    return Work(Session(0, 0), ChunkRequest("x", (observation(0),), "x", 0, number))


def test_what_waits_is_answered_together_and_each_gets_its_own() -> None:
    policy = Waiting()
    thread = ComputeThread(policy)
    first = thread.submit(work(0))
    assert policy.begun.wait(30)
    others = [thread.submit(work(number)) for number in range(1, 6)]
    left = others[2].cancel()  # its client has gone
    policy.go.set()
    assert first.result(30)[0, 0] == 0
    assert left
    for number, future in enumerate(others, 1):
        if number != 3:
            assert future.result(30)[0, 0] == number
    assert policy.sizes == [1, 4]
    assert thread.close()


def test_a_policy_whose_actions_depend_on_the_batch_is_refused_for_good() -> None:
    policy = Waiting()
    policy.go.set()
    thread = ComputeThread(policy)
    for number in (9, 1):
        with pytest.raises(BatchingError, match="who shares a batch"):
            thread.submit(work(number)).result(30)
    assert thread.close()


def test_the_end_answers_what_waits_and_refuses_what_comes() -> None:
    policy = Waiting()
    thread = ComputeThread(policy)
    waiting: list[Future[Any]] = [thread.submit(work(number)) for number in range(3)]
    assert not thread.close(0.05)  # it still computes
    policy.go.set()
    assert thread.close()
    assert [future.result(1)[0, 0] for future in waiting] == [0, 1, 2]
    with pytest.raises(RuntimeError, match="ending"):
        thread.submit(work(3)).result(1)
