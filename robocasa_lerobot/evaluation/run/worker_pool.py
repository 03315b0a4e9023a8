"""The pool of worker processes: hands out trials, survives crashes and hangs, restarts what dies."""

from __future__ import annotations

import collections
import multiprocessing.connection
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.planning.trials import TrialSpec
from robocasa_lerobot.evaluation.records.results import CRASHED, HUNG
from robocasa_lerobot.evaluation.run.messages import Alive, Finished, Outcome, Ready, Refused, WorkerSettings
from robocasa_lerobot.evaluation.run.policy_servers import LOADING_SECONDS, ServerPool
from robocasa_lerobot.evaluation.run.processes import WORKER, cause_of_death, process_context, run_in, thread_limit

# That end with an error; lost connections are counted apart.
MAX_ATTEMPTS = 2
# Of a trial whose policy behind a socket is lost so often; then the run ends, because no other trial will fare better.
MAX_LOST = 3
# A worker that dies before it is ready dies of its surroundings (imports, memory); trying for ever would not help.
MAX_FAILED_STARTS = 3
# A start takes seconds, on a machine with too much to do many.
START_SECONDS = 180.0
_POLL_SECONDS = 0.5


@dataclass(frozen=True)
class Completed:
    """An attempt that has ended; from `WorkerPool.run`, the last one at its trial.

    `attempts`: made at the trial so far. `lost`: those among them that lost the connection to their policy.
    """

    spec: TrialSpec
    result: Finished
    attempts: int
    earlier: Finished | None
    lost: int = 0


@dataclass
class _Attempt:
    spec: TrialSpec
    number: int = 1
    earlier: Finished | None = None
    lost: int = 0

    def ended(self, result: Finished) -> Completed:
        """This attempt with its result."""
        return Completed(self.spec, result, self.number, self.earlier, self.lost + (result.lost is not None))


@dataclass
class _Slot:
    process: ForkServerProcess
    connection: Connection
    last_sign: float
    render_device: int | None = None
    server: str | None = None
    ready: bool = False
    loads: bool = False
    attempt: _Attempt | None = None
    given_at: float = 0.0


class WorkerPool:
    """Runs trials in `size` processes, each with its own pipe.

    A pipe for each worker and not one shared queue: a process that is killed while it holds a queue's lock would
    block all the others.

    Args:
        settings: what each worker gets.
        size: number of processes.
        stall_seconds: a worker without a sign of life for so long is killed and replaced.
        servers: policy servers that the workers are dealt out to; watched here while trials run.
    """

    def __init__(
        self, settings: WorkerSettings, size: int, stall_seconds: float, servers: ServerPool | None = None
    ) -> None:
        self._settings, self._size, self._stall_seconds = settings, size, stall_seconds
        self._servers = servers
        self._context = process_context(any(source.is_checkpoint for source in settings.sources.values()))
        self._slots: list[_Slot] = []
        self._failed_starts = 0

    def run(self, specs: Sequence[TrialSpec], more: Callable[[], Sequence[TrialSpec]] = tuple) -> Iterator[Completed]:
        """The trials as they complete, in no particular order; workers are ended when the iterator is closed.

        Args:
            specs: trials to run.
            more: asked once for further trials, when all of `specs` are done and the workers are still there.

        Raises:
            UserError: a policy or an env cannot be built, or workers cannot be started.
        """
        pending = collections.deque(_Attempt(spec) for spec in specs)
        asked = finished = False
        try:
            while True:
                if not pending and not any(slot.attempt for slot in self._slots):
                    if asked:
                        break
                    asked = True
                    pending.extend(_Attempt(spec) for spec in more())
                    continue
                busy = sum(slot.attempt is not None for slot in self._slots)
                while len(self._slots) < min(self._size, busy + len(pending)):
                    self._slots.append(self._start())
                for slot in self._slots:
                    if slot.ready and slot.attempt is None and pending and self._may_begin(pending[0].spec):
                        self._give(slot, pending.popleft())
                for completed in self._collect():
                    result, number, lost = completed.result, completed.attempts, completed.lost
                    if result.lost is not None and lost >= MAX_LOST:
                        raise UserError(_gave_up(completed, result.lost))
                    if result.error is not None and (result.lost is not None or number - lost < MAX_ATTEMPTS):
                        pending.appendleft(_Attempt(completed.spec, number + 1, completed.earlier or result, lost))
                    else:
                        yield completed
            finished = True
        finally:
            self._end(gently=finished)

    def _collect(self) -> Iterator[Completed]:
        """What the workers report within a short wait."""
        # The pipe of a dead worker reports end-of-file, so the pipes alone tell of deaths too.
        waiting: dict[object, _Slot] = {slot.connection: slot for slot in self._slots}
        watched = [] if self._servers is None else self._servers.connections
        reporting = multiprocessing.connection.wait([*(s.connection for s in self._slots), *watched], _POLL_SECONDS)
        if self._servers is not None:
            self._servers.attend(reporting)
        for connection in reporting:
            if connection not in waiting:
                continue
            slot = waiting[connection]
            try:
                message = slot.connection.recv()
            except (EOFError, ConnectionResetError):
                yield from self._bury(slot, cause_of_death(slot.process), CRASHED)
                continue
            slot.last_sign = time.monotonic()
            if isinstance(message, Ready):
                slot.ready, self._failed_starts = True, 0
            elif isinstance(message, Refused):
                raise UserError(message.message)
            elif isinstance(message, Finished):
                attempt, slot.attempt = slot.attempt, None
                assert attempt is not None, "a worker reported a trial that it was not given"
                yield attempt.ended(message)
            else:
                assert isinstance(message, Alive), message
                slot.loads = message.loads
        now = time.monotonic()
        for slot in list(self._slots):
            limit = self._stall_seconds if slot.ready else max(self._stall_seconds, START_SECONDS)
            if slot.loads:
                limit = max(limit, LOADING_SECONDS)
            if (slot.attempt is not None or not slot.ready) and now - slot.last_sign > limit:
                slot.process.kill()
                remedy = "a slow machine needs more `stall_seconds`"
                cause = f"no progress for {limit:g} s; the worker was killed ({remedy})"
                yield from self._bury(slot, cause, HUNG)

    def _bury(self, slot: _Slot, cause: str, kind: str) -> Iterator[Completed]:
        """Remove a dead worker; its trial, if it had one, ends with the cause as its error."""
        slot.process.join(timeout=10)
        slot.connection.close()
        self._slots.remove(slot)
        if slot.attempt is not None:
            result = Finished(Outcome(), None, time.monotonic() - slot.given_at, cause, kind)
            yield slot.attempt.ended(result)
        elif not slot.ready:
            self._failed_starts += 1
            if self._failed_starts >= MAX_FAILED_STARTS:
                raise UserError(f"{self._failed_starts} workers ended before they were ready: {cause}. See above.")

    def _start(self) -> _Slot:
        ours, theirs = self._context.Pipe()
        device, server = self._least_used_device(), self._least_used_server()
        with thread_limit(self._settings.threads):
            environment = dict(os.environ)
            process = self._context.Process(
                target=run_in, args=(WORKER, theirs, self._settings, device, server, environment), daemon=True
            )
            process.start()
        theirs.close()  # Else end-of-file would never come.
        return _Slot(process, ours, time.monotonic(), device, server)

    def _least_used_device(self) -> int | None:
        used = collections.Counter(slot.render_device for slot in self._slots)
        return min(self._settings.render_devices, key=lambda device: used[device], default=None)

    def _least_used_server(self) -> str | None:
        used = collections.Counter(slot.server for slot in self._slots)
        addresses = [] if self._servers is None else self._servers.addresses
        return min(addresses, key=lambda address: used[address], default=None)

    def _may_begin(self, spec: TrialSpec) -> bool:
        """Whether a trial of this policy may run now: a server holds one policy, so that they come one by one."""
        running = {slot.attempt.spec.label for slot in self._slots if slot.attempt is not None}
        return not self._settings.served or running <= {spec.label}

    def _give(self, slot: _Slot, attempt: _Attempt) -> None:
        slot.attempt, slot.given_at = attempt, time.monotonic()
        slot.last_sign = slot.given_at
        # A worker that died while idle: the next look at its pipe says so, and the trial is tried again.
        with suppress(BrokenPipeError, ConnectionResetError):
            slot.connection.send(attempt.spec)

    def _end(self, gently: bool) -> None:
        for slot in self._slots:
            if gently:
                with suppress(BrokenPipeError, ConnectionResetError):
                    slot.connection.send(None)
            else:
                slot.process.kill()
        deadline = time.monotonic() + 10
        for slot in self._slots:
            slot.process.join(timeout=max(0.1, deadline - time.monotonic()))
            if slot.process.is_alive():
                slot.process.kill()
                slot.process.join()
            slot.connection.close()
        self._slots.clear()


def _gave_up(completed: Completed, why: str) -> str:
    spec = completed.spec
    return (
        f"policy {spec.label!r} was lost {completed.lost} times during {spec.task} trial {spec.trial}: {why}. What "
        "has been recorded stays; start the server again, and the same command goes on."
    )
