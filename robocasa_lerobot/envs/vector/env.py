"""A vector env over worker processes that says which of them failed, why, and in which episode and step."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, NoReturn

import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from gymnasium.vector.async_vector_env import AsyncState

from robocasa_lerobot import gl
from robocasa_lerobot.envs.seeds import SEEDS, is_seed
from robocasa_lerobot.envs.vector.worker import (
    BEGIN,
    STATUS_FIELDS,
    WHERE_SIGNAL,
    Failure,
    Member,
    Note,
    Progress,
    Raised,
    progress_of,
    serve,
)
from robocasa_lerobot.errors import UnknownNameError, UserError

CONTEXTS = ("forkserver", "spawn")  # a plain fork would inherit the driver's threads of a parent that has rendered
# Imported once, in the server that workers are forked from: two workers start in 0.04 s instead of 0.7.
_PRELOAD = ("__main__", "robocasa_lerobot.envs.kitchen_env", "robocasa_lerobot.envs.vector.worker")
CLOSE_SECONDS = 5.0
# A dead worker's pipe tells at once; that another one died while this one works on is looked up so often.
_POLL_SECONDS = 0.2
_WHERE_SECONDS = 2.0


class WorkerError(RuntimeError):
    """A worker of a vector env failed, died or hung; the vector env is closed, and its other workers have ended.

    `__cause__` is the exception that was raised in the worker, if there was one that could be sent.

    Attributes:
        index: the worker's, and its env's.
        task: the task's name, or the factory's.
        progress: its phase, the seed of its episode (None if unknown) and the episode's control steps.
        worker_traceback: where it was; empty for a process that was killed.
    """

    def __init__(
        self, index: int, task: str, progress: Progress, what: str, why: str, worker_traceback: str = ""
    ) -> None:
        self.index, self.task, self.progress = index, task, progress
        self.worker_traceback = worker_traceback.rstrip()
        seed = "of unknown seed" if progress.seed is None else f"of seed {progress.seed}"
        where = {
            "start-up": "while it was starting",
            "step": f"in step {progress.steps} of the episode {seed}",
            "reset": f"in the reset to the episode {seed}",
            "autoreset": f"in the automatic reset to the episode {seed}",
            "waiting": f"while it was idle, after step {progress.steps} of the episode {seed}",
        }.get(progress.phase, f"in a {progress.phase}, after step {progress.steps} of the episode {seed}")
        details = f"\n\nIn the worker:\n{self.worker_traceback}" if self.worker_traceback else ""
        super().__init__(f"env worker {index} (task {task}) {what} {where}: {why}\nThe vector env is closed.{details}")

    def __reduce__(self) -> Any:
        """Errors of nested processes are sent on: rebuild from the message, as the arguments differ from it."""
        return _restored_error, (self.args[0], self.__dict__.copy())


def _restored_error(message: str, attributes: dict[str, Any]) -> WorkerError:
    error = WorkerError.__new__(WorkerError, message)
    error.__dict__.update(attributes)
    return error


class KitchenVectorEnv(AsyncVectorEnv):
    """Gymnasium's async vector env whose workers report their failures; made by `make_vector_env`.

    Seeds: `reset(seed=s)` gives env i the seed s + i, `reset(seed=[...])` each its own. Further episodes draw their
    seeds from the env's own generator, exactly as a single env that is reset without a seed does, so one env's
    episodes depend neither on the other envs nor on their number. `infos["seed"]` has the seed of each episode.

    Infos are arrays over the envs: `success` bool, `seed` int64, `instruction` and `task` objects (strings),
    `success_terms` and `scene` dictionaries of such arrays; `env_info(infos, i)` gives one env's own.

    Failure: `WorkerError` from whichever method meets it, after which the vector env is closed. An exception in a
    method that is called through `call` or `get_attr` is raised as itself, and ends nothing.
    """

    def __init__(
        self,
        members: Sequence[Member],
        autoreset: AutoresetMode,
        context: str,
        timeout_seconds: float | None,
        copy: bool,
    ) -> None:
        if context not in CONTEXTS:
            raise UnknownNameError("process context", context, CONTEXTS)
        self._members, self._timeout_seconds = list(members), timeout_seconds
        self._renderers: list[str | None] = [None] * len(members)
        self._tasks = [member.label for member in members]
        self._ended = np.zeros(len(members), dtype=bool)
        self._links: list[_Link] = []
        processes = multiprocessing.get_context(context)
        if context == "forkserver":
            processes.set_forkserver_preload(list(_PRELOAD))
        self._status = processes.RawArray("q", STATUS_FIELDS * len(members))
        self.processes: list[Any] = []
        try:
            super().__init__(
                self._members,
                context=context,
                worker=partial(serve, self._status),
                autoreset_mode=autoreset,
                copy=copy,
            )
        except BaseException:
            if not self.closed:
                self.close(terminate=True)
            raise

    @property
    def renderers(self) -> tuple[str | None, ...]:
        """What each worker renders with, as OpenGL names it; None for one that has not rendered yet."""
        return tuple(self._renderers)

    @property
    def renderer(self) -> str | None:
        """The renderers' names, usually one, joined; None before the first picture."""
        return ", ".join(sorted({name for name in self._renderers if name is not None})) or None

    def reset_async(
        self, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> None:
        """Begin a reset.

        Raises:
            UserError: not one seed for each env, or one that is no whole number from 0 to 2**63 - 1.
        """
        seeds = _seeds(seed, self.num_envs)
        options = dict(options) if options is not None else None  # Gymnasium takes the mask out of the caller's own
        mask = (options or {}).get("reset_mask", True)
        super().reset_async(seeds, options)
        self._ended &= ~np.asarray(mask, dtype=bool)

    def step_async(self, actions: Any) -> None:
        """Begin a step.

        Raises:
            UserError: actions of another shape, or without autoreset an env whose episode has ended.
        """
        # Gymnasium notices only when it has sent some of them: those envs would be a step ahead from then on.
        if np.shape(actions) != self.action_space.shape:
            raise UserError(f"actions: found shape {np.shape(actions)}, expected {self.action_space.shape}.")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._ended.any():
            ended = np.flatnonzero(self._ended).tolist()
            raise UserError(f"envs {ended}: their episodes have ended; reset them (options={{'reset_mask': ...}}).")
        super().step_async(actions)

    def step_wait(self, timeout: float | None = None) -> Any:
        """The step's results."""
        results = super().step_wait(timeout)
        self._ended = results[2] | results[3]
        return results

    def call_async(self, name: str, *args: Any, **kwargs: Any) -> None:
        """Begin a call of a method of each env; after `set_state` and `reset` an episode runs, whatever was before."""
        super().call_async(name, *args, **kwargs)
        if name in BEGIN:
            self._ended[:] = False

    def call_wait(self, timeout: float | None = None) -> tuple[Any, ...]:
        """The results of a call; an exception in an env is raised as itself, with the worker's traceback as a note."""
        results = super().call_wait(timeout)
        for index, result in enumerate(results):
            if isinstance(result, Raised):
                error = result.failure.exception() or RuntimeError(result.failure.summary)
                error.add_note(f"In env worker {index}:\n{result.failure.traceback}")
                raise error
        return tuple(results)

    def close_extras(self, timeout: float | None = None, terminate: bool = False) -> None:
        """End the workers: each finishes the command it is at, those that take longer than `timeout` are killed."""
        for pipe in self._links or getattr(self, "parent_pipes", []):
            pipe.close()  # which a worker sees as the end of its work
        deadline = time.monotonic() + (0.0 if terminate else CLOSE_SECONDS if timeout is None else timeout)
        for process in self.processes:
            process.join(max(0.0, deadline - time.monotonic()))
        for process in self.processes:
            if process.is_alive():
                process.kill()
        for process in self.processes:
            process.join(CLOSE_SECONDS)
        if hasattr(self, "error_queue"):
            self.error_queue.close()
        for member in self._members:
            member.faults.file.close()
        self._state = AsyncState.DEFAULT

    def _check_spaces(self) -> None:
        # Gymnasium's constructor calls it last, and nothing before it talks to the workers.
        pipes: list[Connection] = self.parent_pipes  # type: ignore[has-type]
        self._links = [_Link(self, index, pipe) for index, pipe in enumerate(pipes)]
        self.parent_pipes = self._links
        super()._check_spaces()

    def receive(self, index: int) -> Any:
        """The next answer of worker `index`; for `_Link`."""
        link = self._links[index]
        while True:
            if link.connection.poll(_POLL_SECONDS):
                try:
                    message = link.connection.recv()
                except (EOFError, ConnectionResetError):
                    self.fail(index)
                if isinstance(message, Note):
                    self._take(index, message)
                elif isinstance(message, Failure):
                    self.fail(index, message)
                else:
                    return message
                continue
            sentinels = {process.sentinel: i for i, process in enumerate(self.processes)}
            for sentinel in multiprocessing.connection.wait(list(sentinels), 0):
                self.fail(sentinels[sentinel])
            if self._timeout_seconds is not None and time.monotonic() - link.sent > self._timeout_seconds:
                self._fail_hanging(index)

    def fail(self, index: int, failure: Failure | None = None) -> NoReturn:
        """Close everything and raise what happened to worker `index`; for `_Link`."""
        link, process = self._links[index], self.processes[index]
        with suppress(EOFError, OSError):
            while failure is None and link.connection.poll(0):
                message = link.connection.recv()
                if isinstance(message, Note):
                    self._take(index, message)
                failure = message if isinstance(message, Failure) else None
        progress = progress_of(self._status, index)
        if failure is not None:
            what, why, details, cause = "failed", failure.summary, failure.traceback, failure.exception()
        else:
            process.join(CLOSE_SECONDS)
            details, cause = self._members[index].faults.text(), None
            what, why = "died", _cause_of_death(process.exitcode, progress)
        self.close()
        raise WorkerError(index, self._tasks[index], progress, what, why, details) from cause

    def _take(self, index: int, note: Note) -> None:
        if note.task is not None:
            self._tasks[index] = note.task
        if note.renderer is not None:
            self._renderers[index] = note.renderer
            gl.announce(note.renderer)

    def _fail_hanging(self, index: int) -> NoReturn:
        process, faults = self.processes[index], self._members[index].faults
        progress = progress_of(self._status, index)
        with suppress(ProcessLookupError):
            os.kill(process.pid, WHERE_SIGNAL)
        deadline = time.monotonic() + _WHERE_SECONDS
        while not faults.text() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.05)  # it is written line by line
        process.kill()
        why = f"it gave no answer for {self._timeout_seconds:g} s"
        error = WorkerError(index, self._tasks[index], progress, "was killed", why, faults.text())
        self.close()
        raise error


class _Link:
    """The parent's end of a pipe, as Gymnasium's code uses it; a worker's death arrives as `WorkerError`."""

    def __init__(self, owner: KitchenVectorEnv, index: int, connection: Connection) -> None:
        self._owner, self._index, self.connection = owner, index, connection
        self.sent = time.monotonic()

    @property
    def closed(self) -> bool:
        return self.connection.closed

    def send(self, message: Any) -> None:
        self.sent = time.monotonic()
        try:
            self.connection.send(message)
        except (BrokenPipeError, ConnectionResetError):
            self._owner.fail(self._index)

    def recv(self) -> Any:
        return self._owner.receive(self._index)

    def poll(self, timeout: float | None = 0.0) -> bool:
        return self.connection.poll(timeout)

    def close(self) -> None:
        self.connection.close()


def _seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    if seed is None:
        return [None] * count
    if isinstance(seed, (int, np.integer)):
        seed = [int(seed) + index for index in range(count)]
    seeds = list(seed)
    if len(seeds) != count or any(not (one is None or is_seed(one)) for one in seeds):
        raise UserError(f"seed: found {seed!r}, expected {SEEDS}, or a list of {count} of them.")
    return [None if one is None else int(one) for one in seeds]


def _cause_of_death(exit_code: int | None, progress: Progress) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"killed by {name}" + (", perhaps for want of memory" if name == "SIGKILL" else "")
    if progress.phase == "start-up":
        return (
            f"exit status {exit_code}; its own output above says why, and a script that makes vector envs needs "
            "`if __name__ == '__main__':`"
        )
    return f"exit status {exit_code}"
