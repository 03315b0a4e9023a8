"""Processes that measure: started, asked one question at a time, and ended, whatever happens."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

ANSWER_TIMEOUT_S = 600.0
BARRIER_S = 0.3  # from the question to the common start, for every process to have read it


class WorkerError(RuntimeError):
    """A measuring process reported an error, died or did not answer; the message has its own words."""


class Worker:
    """One measuring process, which answers JSON lines (`peers/sim_loop.py`)."""

    def __init__(self, name: str, python: Path, program: Path) -> None:
        self.name = name
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
        # An active environment's variables would lead the peer's Python to our packages.
        environment = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONPATH", "PYTHONHOME")}
        start = time.perf_counter()
        self._process = subprocess.Popen(
            [str(python), str(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env=environment,
            text=True,
            bufsize=1,
        )
        try:
            self.ask("hello")
        except BaseException:
            self.close()
            raise
        self.startup_s = time.perf_counter() - start  # the interpreter and its imports

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def ask(self, command: str, **arguments: Any) -> dict[str, Any]:
        """The answer to a command.

        Raises:
            WorkerError: the process reported an error, ended, or was silent for ten minutes.
        """
        self.send(command, **arguments)
        return self.receive()

    def send(self, command: str, **arguments: Any) -> None:
        """Give a command; its answer must be received before the next one."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"command": command, **arguments}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise WorkerError(f"{self.name} ended: {self._last_words()}") from None

    def receive(self) -> dict[str, Any]:
        """The answer to the command that was sent; see `ask`."""
        assert self._process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            if not selector.select(ANSWER_TIMEOUT_S):
                raise WorkerError(f"{self.name} has not answered for {ANSWER_TIMEOUT_S:.0f} s: {self._last_words()}")
        line = self._process.stdout.readline()
        if not line:
            status = self._process.wait()
            raise WorkerError(f"{self.name} ended with status {status}: {self._last_words()}")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise WorkerError(f"{self.name}: {answer['error']}")
        return answer

    def close(self) -> None:
        """End the process."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._process.stdin.close()  # ends its loop
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._said.close()

    def _last_words(self) -> str:
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return "\n".join(lines[-15:]) or "it said nothing"


def run_together(workers: Sequence[Worker], seconds: float, seed: int, standing: bool = False) -> list[dict[str, Any]]:
    """Let workers step at the same time, from one common instant on, each in its own episodes.

    With `standing` base and torso are not commanded.

    Returns:
        For each worker the steps, the seconds that they took, and what `peers/sim_loop.py` says beside them.
    """
    for i, worker in enumerate(workers):
        worker.send("prepare", seed=seed + 100 * i, standing=standing)
    for worker in workers:
        worker.receive()
    at = time.perf_counter() + BARRIER_S
    for worker in workers:
        worker.send("run", at=at, seconds=seconds)
    return [worker.receive() for worker in workers]
