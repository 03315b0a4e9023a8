"""The child side of a vector env: one env in a process of its own, which answers commands from a pipe.

It speaks the protocol of Gymnasium's `AsyncVectorEnv` (command and data in, answer and True out) and tells more than
that does: which episode and step it is in (in shared memory, so that it is known after a SIGKILL too), why it failed
(with its traceback), where it hangs, and what renders.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.reduction import DupFd, ForkingPickler
from typing import IO, Any

import gymnasium
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import write_to_shared_memory

from robocasa_lerobot import gl
from robocasa_lerobot.envs.seeds import LARGEST_SEED

EnvFactory = Callable[[], gymnasium.Env[Any, Any]]

# At this signal a worker writes where it is to its fault file, even if it hangs inside compiled code.
WHERE_SIGNAL = signal.SIGUSR1
BEGIN = ("reset", "set_state")  # methods after which an episode runs, whatever was before
PHASES = ("start-up", "waiting", "reset", "step", "autoreset", "call")
# Numbers of a worker in the shared status: phase, whether the seed is known, seed, steps of the episode.
STATUS_FIELDS = 4


class FaultFile:
    """A file without a name that the parent opens and a worker inherits: crashes and hangs leave their stack there."""

    def __init__(self) -> None:
        self.file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the vector env)

    def __getstate__(self) -> Any:
        return DupFd(self.file.fileno())

    def __setstate__(self, handle: Any) -> None:
        self.file = os.fdopen(handle.detach(), "r+b", buffering=0)

    def text(self) -> str:
        """What was written so far; nothing once the file is closed."""
        if self.file.closed:
            return ""
        return os.pread(self.file.fileno(), 2**20, 0).decode(errors="replace").strip()


@dataclass(frozen=True)
class Member:
    """One env of a vector env: how to make it, how to name it in messages, and where it renders.

    `backend`, `device` and `variables` of the environment are given along because a fork server has those of its own
    start.
    """

    make: EnvFactory
    label: str
    backend: str | None
    device: int | None
    faults: FaultFile
    variables: Mapping[str, str] = field(default_factory=dict)

    def __call__(self) -> gymnasium.Env[Any, Any]:
        """The env; Gymnasium makes one in the parent too, to read its spaces."""
        return self.make()


@dataclass(frozen=True)
class Progress:
    """Where a worker is: `steps` counts the episode's control steps with the present one, `seed` is the episode's."""

    phase: str
    seed: int | None
    steps: int


@dataclass(frozen=True)
class Note:
    """Comes before an answer: the env's task once it is made, the OpenGL renderer's name once something was drawn."""

    task: str | None = None
    renderer: str | None = None


@dataclass(frozen=True)
class Failure:
    """Comes in place of an answer, and is the worker's last message; `error` is pickled, None if it cannot be."""

    summary: str
    traceback: str
    error: bytes | None

    @classmethod
    def of(cls, error: BaseException) -> Failure:
        """The failure that `error` stands for."""
        summary = "".join(traceback.format_exception_only(error)).strip()
        return cls(summary, "".join(traceback.format_exception(error)), _pickled(error))

    def exception(self) -> BaseException | None:
        """The error itself, where it can be had on this side."""
        if self.error is None:
            return None
        try:
            found = pickle.loads(self.error)
        except Exception:
            return None
        return found if isinstance(found, BaseException) else None


@dataclass(frozen=True)
class Raised:
    """The answer to a `call` that raised or gave what cannot be sent; unlike a failure of a step it ends nothing."""

    failure: Failure


class ParentGoneError(Exception):
    """Nobody reads this worker's answers any more."""


def progress_of(status: Any, index: int) -> Progress:
    """What worker `index` last wrote into the shared status."""
    phase, known, seed, steps = status[STATUS_FIELDS * index : STATUS_FIELDS * (index + 1)]
    return Progress(PHASES[phase], seed if known else None, steps)


def serve(
    status: Any,
    index: int,
    env_fn: Any,
    pipe: Connection,
    parent_pipe: Connection,
    shared_memory: Any,
    error_queue: Any,
    autoreset_mode: AutoresetMode,
    semaphore: Any,
) -> None:
    """Main function of worker `index`; after `status` the arguments are those of Gymnasium's own workers.

    Gymnasium's error queue is not used: a worker that is killed while it holds the queue's lock would block all others.
    """
    parent_pipe.close()  # else this process would keep its own pipe open, and never see that the parent has gone
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent ends its workers
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    member: Member = env_fn.fn
    faulthandler.enable(member.faults.file)
    faulthandler.register(WHERE_SIGNAL, member.faults.file, all_threads=True)
    # The parent announces it, once for all workers.
    warnings.filterwarnings("ignore", category=gl.SoftwareRenderingWarning)
    worker = _Worker(index, pipe, status, shared_memory, autoreset_mode)
    os.environ.update(member.variables)
    try:
        if member.backend is not None:
            gl.use(member.backend, member.device)
        worker.run(member.make)
    except ParentGoneError:
        pass
    except BaseException as error:
        worker.report(error)
    finally:
        worker.close()


class _Worker:
    def __init__(self, index: int, pipe: Connection, status: Any, memory: Any, mode: AutoresetMode) -> None:
        self._index, self._pipe, self._status, self._memory, self._mode = index, pipe, status, memory, mode
        self._env: gymnasium.Env[Any, Any] | None = None
        self._ended = False
        self._renderer_told = False
        self._steps = 0
        self._write(phase="start-up", steps=0)

    def run(self, make: EnvFactory) -> None:
        """Make the env and answer commands until the pipe closes."""
        self._env = env = make()
        self._send(Note(task=getattr(env.unwrapped, "task", None)))
        handlers: dict[str, Callable[..., Any]] = {
            "reset": self._explicit_reset,
            "reset-noop": lambda env, data: (None, {}),
            "step": self._step,
            "_call": self._call,
            "_setattr": lambda env, data: env.set_wrapper_attr(*data),
            "_check_spaces": _same_spaces,
        }
        while True:
            try:
                command, data = self._pipe.recv()
            except (EOFError, OSError):
                return
            answer = handlers[command](env, data)
            self._write(phase="waiting")
            renderer = None if self._renderer_told else gl.used_renderer()
            if renderer is not None:
                self._send(Note(renderer=renderer))
                self._renderer_told = True
            self._send((answer, True))

    def report(self, error: BaseException) -> None:
        """Tell the parent why this worker ends."""
        try:
            self._send(Failure.of(error))
        except ParentGoneError:
            traceback.print_exception(error)

    def close(self) -> None:
        """Close the env; what goes wrong then is printed, as nobody waits for it."""
        if self._env is not None:
            try:
                self._env.close()
            except Exception:
                traceback.print_exc()

    def _explicit_reset(self, env: gymnasium.Env[Any, Any], data: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        observation, info = self._reset(env, "reset", data["seed"], data["options"])
        return self._stored(env, observation), info

    def _step(self, env: gymnasium.Env[Any, Any], action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        if self._ended and self._mode == AutoresetMode.NEXT_STEP:
            observation, info = self._reset(env, "autoreset")
            return self._stored(env, observation), 0.0, False, False, info
        self._steps += 1
        self._write(phase="step", steps=self._steps)
        observation, reward, terminated, truncated, info = env.step(action)
        self._ended = bool(terminated or truncated)
        if self._ended and self._mode == AutoresetMode.SAME_STEP:
            final = {"final_obs": observation, "final_info": info}
            observation, info = self._reset(env, "autoreset")
            info = {**final, **info}
        return self._stored(env, observation), float(reward), bool(terminated), bool(truncated), info

    def _reset(
        self, env: gymnasium.Env[Any, Any], phase: str, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        self._steps = 0
        # What the env will draw for itself, so that it is known if the reset kills this process.
        next_seed = getattr(env.unwrapped, "next_seed", None)
        expected = next_seed() if seed is None and next_seed is not None else seed
        self._write(phase=phase, seed=(expected,), steps=0)
        observation, info = env.reset(seed=seed, options=options)
        self._ended = False
        if isinstance(info.get("seed"), int):
            self._write(seed=(info["seed"],))
        return observation, info

    def _call(self, env: gymnasium.Env[Any, Any], data: tuple[str, tuple[Any, ...], dict[str, Any]]) -> Any:
        name, args, kwargs = data
        self._write(phase="call")
        try:
            attribute = env.get_wrapper_attr(name)
            result = attribute(*args, **kwargs) if callable(attribute) else attribute
            if name in BEGIN:
                self._ended, self._steps = False, int(getattr(env.unwrapped, "steps", 0))
            ForkingPickler.dumps(result)  # what cannot be sent fails here, and not the worker
            return result
        except Exception as error:
            return Raised(Failure.of(error))

    def _stored(self, env: gymnasium.Env[Any, Any], observation: Any) -> Any:
        """Leave the observation in the shared memory; where there is none it travels in the answer."""
        if not self._memory:
            return observation
        write_to_shared_memory(env.observation_space, self._index, observation, self._memory)
        return None

    def _send(self, message: Any) -> None:
        try:
            self._pipe.send(message)
        except (BrokenPipeError, ConnectionResetError) as error:
            raise ParentGoneError from error

    def _write(
        self, *, seed: tuple[int | None] | None = None, steps: int | None = None, phase: str | None = None
    ) -> None:
        """Change those parts of the shared status that are given; the seed comes as a tuple, as it may be None."""
        start = STATUS_FIELDS * self._index
        if seed is not None:
            known = seed[0] is not None and seed[0] < LARGEST_SEED
            self._status[start + 1 : start + 3] = [known, seed[0] if known else 0]
        if steps is not None:
            self._status[start + 3] = steps
        if phase is not None:
            self._status[start] = PHASES.index(phase)


def _same_spaces(env: gymnasium.Env[Any, Any], data: tuple[Any, Any, Any]) -> tuple[bool, bool]:
    _, observation_space, action_space = data
    return observation_space == env.observation_space, action_space == env.action_space


def _leave_with_parent() -> None:
    """End this process at once when the one that started it has gone, whatever it is doing."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _pickled(error: BaseException) -> bytes | None:
    try:
        data = pickle.dumps(error)
        pickle.loads(data)  # some exceptions can be packed, but not unpacked
    except Exception:
        return None
    return data
