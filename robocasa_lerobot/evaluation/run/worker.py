"""A worker process: its own env, one trial after another from its pipe; the policy here, or in a policy server."""

from __future__ import annotations

import importlib
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import gymnasium

from robocasa_lerobot import gl
from robocasa_lerobot.envs.robots.control_step import DivergedError
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import Actor
from robocasa_lerobot.evaluation.actors.chunk_policy import BatchingError
from robocasa_lerobot.evaluation.actors.policy_runner import load_actor
from robocasa_lerobot.evaluation.actors.remote_actor import RemoteActor
from robocasa_lerobot.evaluation.planning.trials import TrialSpec
from robocasa_lerobot.evaluation.records.results import CRASHED, DIVERGED, file_name
from robocasa_lerobot.evaluation.remote.failures import LostError
from robocasa_lerobot.evaluation.remote.translation import UnfitEnvError
from robocasa_lerobot.evaluation.run.film import Film, FilmError, NoPicturesError
from robocasa_lerobot.evaluation.run.messages import Alive, Finished, Outcome, Ready, Refused, WorkerSettings
from robocasa_lerobot.evaluation.run.policy_server import PolicyConnection
from robocasa_lerobot.evaluation.run.processes import take_over
from robocasa_lerobot.evaluation.run.rollout import horizon_of, run_trial
from robocasa_lerobot.evaluation.run.success import SuccessRule
from robocasa_lerobot.evaluation.simulators.fit import UnfitPolicyError, needs_of
from robocasa_lerobot.evaluation.simulators.foreign_env import ForeignEnv

EnvFactory = Callable[..., gymnasium.Env[Any, Any]]


def worker_main(
    connection: Connection,
    settings: WorkerSettings,
    render_device: int | None,
    server: str | None,
    environment: dict[str, str],
) -> None:
    """Serve trials from `connection` until it gives None or closes.

    Pictures are drawn on `render_device`; `server` is the address of the policy server.
    """
    take_over(environment)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent ends its workers.
    warnings.filterwarnings("ignore", category=gl.SoftwareRenderingWarning)  # the parent has announced it
    if render_device is not None:
        gl.use("egl", render_device)  # the parent has checked it
    worker = _Worker(connection, settings, server)
    try:
        connection.send(Ready())
        while (spec := connection.recv()) is not None:
            connection.send(worker.run(spec))
    except (EOFError, BrokenPipeError, ConnectionResetError, _OrphanedError):
        pass  # The parent is gone: nobody waits for this worker any more.
    finally:
        worker.close_env()


class _OrphanedError(Exception):
    """Nobody listens any more. Of a type of its own: pipes of a user's env break too, which is a failed trial."""


class _Worker:
    def __init__(self, connection: Connection, settings: WorkerSettings, server: str | None) -> None:
        self._connection, self._settings = connection, settings
        self._remote = None if server is None else PolicyConnection(server, self._alive)
        self._policy: tuple[str, Actor] | None = None
        self._env: tuple[tuple[Any, ...], gymnasium.Env[Any, Any]] | None = None

    def run(self, spec: TrialSpec) -> Finished | Refused:
        started = time.monotonic()
        video: str | None = None
        try:
            self._alive(-1)
            try:
                env = self._env_of(spec)
            except UserError as error:
                return Refused(str(error))
            policy = self._policy_of(spec.label)
            if isinstance(policy, Refused):
                return policy
            if isinstance(env.unwrapped, ForeignEnv):
                env.unwrapped.needs = needs_of(self._settings.sources[spec.label])
            rule = SuccessRule(self._settings.success_rule, self._settings.success_hold_steps)
            if spec.film:
                video = video_path(spec)
                with Film(Path(self._settings.out) / video, getattr(env.unwrapped, "fps", None)) as film:
                    outcome = run_trial(env, policy, spec, film, self._alive, rule)
            else:
                outcome = run_trial(env, policy, spec, None, self._alive, rule)
        except _OrphanedError:
            raise
        except (BatchingError, FilmError, NoPicturesError, UnfitEnvError, UnfitPolicyError) as error:
            return Refused(str(error))
        except Exception as error:
            # What the trial left behind may be broken as well: the next one starts from a new env and policy.
            self.close_env()
            self._drop_policy()
            kind = DIVERGED if isinstance(error, DivergedError) else CRASHED
            lost = str(error) if isinstance(error, LostError) else None
            return Finished(Outcome(), None, time.monotonic() - started, traceback.format_exc(), kind, lost)
        return Finished(outcome, video, time.monotonic() - started, None)

    def close_env(self) -> None:
        if self._env is not None:
            env, self._env = self._env[1], None
            try:
                env.close()
            except Exception:
                traceback.print_exc()

    def _drop_policy(self) -> None:
        if self._policy is not None:
            actor, self._policy = self._policy[1], None
            if isinstance(actor, RemoteActor):
                actor.close()

    def _alive(self, step: int, loads: bool = False) -> None:
        try:
            self._connection.send(Alive(step, loads))
        except (BrokenPipeError, ConnectionResetError) as error:
            raise _OrphanedError from error

    def _policy_of(self, label: str) -> Actor | Refused:
        if self._policy is None or self._policy[0] != label:
            self._drop_policy()  # Free the last one first: two large policies may not fit.
            settings = self._settings
            source = settings.sources[label]
            if label in settings.served:
                assert self._remote is not None, "a policy is to be served, but there is no server"
                self._policy = (label, self._remote.actor(label))
                return self._policy[1]
            try:
                if source.is_checkpoint:
                    import torch

                    torch.set_num_threads(settings.threads)
                waiting = partial(self._alive, -1)
                self._alive(-1, loads=True)
                actor = load_actor(
                    source, settings.device, settings.executed_steps, settings.width, settings.runtime, waiting
                )
                self._alive(-1)
            except _OrphanedError:
                raise
            except LostError as error:
                return Refused(
                    f"policy {label!r} cannot be asked any more: {error}. What has been recorded stays; start the "
                    "server again, and the same command goes on."
                )
            except Exception as error:
                # No other trial will load it either.
                detail = "" if isinstance(error, UserError) else "\n" + traceback.format_exc()
                return Refused(f"policy {label!r} cannot be loaded: {error}{detail}")
            self._policy = (label, actor)
        return self._policy[1]

    def _env_of(self, spec: TrialSpec) -> gymnasium.Env[Any, Any]:
        wanted = (spec.task, spec.horizon, spec.perturbation)
        if self._env is None or self._env[0] != wanted:
            self.close_env()
            settings = self._settings
            arguments = {**settings.env_kwargs, **settings.perturbations.get(spec.perturbation, {})}
            if not SuccessRule(settings.success_rule, settings.success_hold_steps).ends_early:
                arguments["terminate_on_success"] = False
            env = load_factory(settings.factory)(task=spec.task, horizon=spec.horizon, **arguments)
            self._env = (wanted, env)
            horizon_of(env, spec)
        return self._env[1]


def video_path(spec: TrialSpec) -> str:
    """Where a trial's film lies in the results folder."""
    perturbed = "" if spec.perturbation == "none" else f"{spec.perturbation}_"
    return f"videos/{file_name(spec.label)}/{spec.task}/{perturbed}trial_{spec.trial:03d}.mp4"


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
