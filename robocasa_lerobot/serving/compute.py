"""The one thread that computes, so that the event loop answers health checks and handshakes meanwhile."""

from __future__ import annotations

import queue
import threading
import traceback
from concurrent.futures import Future

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.serving.policy import ServedPolicy, Work

_END = None


class ComputeThread:
    """Answers whatever requests wait, together.

    Args:
        policy: is used by this thread alone.
    """

    def __init__(self, policy: ServedPolicy) -> None:
        self._policy = policy
        self._waiting: queue.SimpleQueue[tuple[Work, Future[NDArray[np.float32]]] | None] = queue.SimpleQueue()
        self._refused: Exception | None = None
        self._lock, self._ending = threading.Lock(), False
        self._thread = threading.Thread(target=self._run, name="policy", daemon=True)
        self._thread.start()

    def submit(self, work: Work) -> Future[NDArray[np.float32]]:
        """Actions (executed, 12) in stored order of a request, when they are computed."""
        future: Future[NDArray[np.float32]] = Future()
        with self._lock:  # nothing comes after the end, where nobody would answer it
            if self._ending:
                future.set_exception(RuntimeError("the server is ending"))
            else:
                self._waiting.put((work, future))
        return future

    def close(self, seconds: float = 10.0) -> bool:
        """End after what waits; False where that takes longer."""
        with self._lock:
            if not self._ending:
                self._ending = True
                self._waiting.put(_END)
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (first := self._waiting.get()) is not _END:
            batch, ended = [first], False
            while not (ended or self._waiting.empty()):
                one = self._waiting.get()
                ended = one is _END
                batch += [] if one is None else [one]
            self._answer([(work, future) for work, future in batch if future.set_running_or_notify_cancel()])
            if ended:
                return

    def _answer(self, batch: list[tuple[Work, Future[NDArray[np.float32]]]]) -> None:
        works = [work for work, _ in batch]
        try:
            if self._refused is not None:
                raise self._refused
            answers = self._policy.answer(works)
        except Exception as error:  # a policy whose actions depend on who shares a batch: it can serve nobody
            self._refused = error
            traceback.print_exc()
            answers = [error] * len(works)
        for (_, future), answer in zip(batch, answers, strict=True):
            if isinstance(answer, Exception):
                future.set_exception(answer)
            elif not np.isfinite(answer).all():
                future.set_exception(ValueError("the policy gave actions that are not finite"))
            else:
                future.set_result(answer)
