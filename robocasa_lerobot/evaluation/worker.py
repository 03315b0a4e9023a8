"""A worker process: its own env and policy replica, one trial after another from its pipe."""

from __future__ import annotations

import importlib
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import gymnasium

from robocasa_lerobot import gl
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.checkpoints import PolicySource
from robocasa_lerobot.evaluation.film import Film
from robocasa_lerobot.evaluation.plan import TrialSpec
from robocasa_lerobot.evaluation.policy_runner import PolicyRunner, load_policy
from robocasa_lerobot.evaluation.results import CRASHED, DIVERGED, FINISHED
from robocasa_lerobot.evaluation.rollout import DivergedError, Outcome, horizon_of, run_trial

EnvFactory = Callable[..., gymnasium.Env[Any, Any]]


@dataclass(frozen=True)
class WorkerSettings:
    """What a worker needs beside the trials themselves; picklable."""

    sources: dict[str, PolicySource]
    factory: str
    env_kwargs: dict[str, Any]
    device: str
    threads: int
    executed_steps: int | None
    out: str
    render_devices: tuple[int, ...] = ()


@dataclass(frozen=True)
class Ready:
    """The worker waits for its first trial."""


@dataclass(frozen=True)
class Alive:
    """A sign of life from inside a trial; `step` is -1 while policy or env are being built."""

    step: int


@dataclass(frozen=True)
class Finished:
    """A trial ended by itself; `error` is the traceback of one that crashed, `kind` is the record's outcome."""

    outcome: Outcome
    video: str | None
    wall_seconds: float
    error: str | None
    kind: str = FINISHED


@dataclass(frozen=True)
class Refused:
    """A fault that no other trial will get around; the whole run ends with this message."""

    message: str


def worker_main(connection: Connection, settings: WorkerSettings, render_device: int | None = None) -> None:
    """Serve trials from `connection` until it gives None or closes; pictures are drawn on `render_device`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent ends its workers.
    warnings.filterwarnings("ignore", category=gl.SoftwareRenderingWarning)  # the parent has announced it
    if render_device is not None:
        gl.use("egl", render_device)  # the parent has checked it
    worker = _Worker(connection, settings)
    try:
        connection.send(Ready())
        while (spec := connection.recv()) is not None:
            connection.send(worker.run(spec))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # The parent is gone: nobody waits for this worker any more.
    finally:
        worker.close_env()


class _Worker:
    def __init__(self, connection: Connection, settings: WorkerSettings) -> None:
        self._connection, self._settings = connection, settings
        self._policy: tuple[str, PolicyRunner] | None = None
        self._env: tuple[tuple[str, int | None], gymnasium.Env[Any, Any]] | None = None

    def run(self, spec: TrialSpec) -> Finished | Refused:
        started = time.monotonic()
        video: str | None = None
        try:
            self._alive(-1)
            try:
                policy = self._policy_of(spec.label)
            except Exception as error:
                # No other trial will load it either.
                detail = "" if isinstance(error, UserError) else "\n" + traceback.format_exc()
                return Refused(f"policy {spec.label!r} cannot be loaded: {error}{detail}")
            try:
                env = self._env_of(spec)
            except UserError as error:
                return Refused(str(error))
            if spec.film:
                video = f"videos/{spec.label}/{spec.task}/trial_{spec.trial:03d}.mp4"
                with Film(Path(self._settings.out) / video) as film:
                    outcome = run_trial(env, policy, spec, film, self._alive)
            else:
                outcome = run_trial(env, policy, spec, None, self._alive)
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise
        except Exception as error:
            # What the trial left behind may be broken as well: the next one starts from a new env and policy.
            self.close_env()
            self._policy = None
            kind = DIVERGED if isinstance(error, DivergedError) else CRASHED
            return Finished(Outcome(), None, time.monotonic() - started, traceback.format_exc(), kind)
        return Finished(outcome, video, time.monotonic() - started, None)

    def close_env(self) -> None:
        if self._env is not None:
            env, self._env = self._env[1], None
            try:
                env.close()
            except Exception:
                traceback.print_exc()

    def _alive(self, step: int) -> None:
        self._connection.send(Alive(step))

    def _policy_of(self, label: str) -> PolicyRunner:
        if self._policy is None or self._policy[0] != label:
            self._policy = None  # Free the last one first: two large policies may not fit.
            source = self._settings.sources[label]
            if not source.is_reference:
                import torch

                torch.set_num_threads(self._settings.threads)
            self._policy = (label, load_policy(source, self._settings.device, self._settings.executed_steps))
        return self._policy[1]

    def _env_of(self, spec: TrialSpec) -> gymnasium.Env[Any, Any]:
        wanted = (spec.task, spec.horizon)
        if self._env is None or self._env[0] != wanted:
            self.close_env()
            factory = load_factory(self._settings.factory)
            env = factory(task=spec.task, horizon=spec.horizon, **self._settings.env_kwargs)
            self._env = (wanted, env)
            horizon_of(env, spec)
        return self._env[1]


def load_factory(factory: str) -> EnvFactory:
    """The callable named `module:callable`.

    Raises:
        UserError: no such module or name.
    """
    module, _, name = factory.partition(":")
    try:
        found: EnvFactory = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise UserError(f"env.factory {factory!r} cannot be imported: {error}") from error
    return found
