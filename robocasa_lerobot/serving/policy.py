"""A policy as a server holds it: what it is, and the chunks of requests from several clients."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import Actor, ChunkRequest
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource, filled_cameras
from robocasa_lerobot.evaluation.actors.chunk_policy import BatchingError, ChunkPolicy, LoadedCheckpoint, default_width
from robocasa_lerobot.evaluation.actors.policy_runner import StepPolicy, load_reference, pick_device
from robocasa_lerobot.serving.request import RequestError, Session

Answer = NDArray[np.float32] | Exception


@dataclass(frozen=True)
class Served:
    """What clients are told about the policy.

    `executed` actions are answered to one request, from the observations at `offsets` (control steps, ascending up to
    0); the policy itself predicts `horizon` of them, for `width` requests at once. `image_size` is (height, width) of
    the pictures of `cameras`, None where it looks at none.
    """

    source: PolicySource
    cameras: tuple[str, ...]
    executed: int
    offsets: tuple[int, ...]
    horizon: int
    width: int = 1

    @property
    def image_size(self) -> tuple[int, int] | None:
        """(height, width) of its pictures, pixels."""
        return self.source.image_size if self.cameras else None

    def describe(self) -> str:
        """The policy in one line."""
        size = "no pictures" if self.image_size is None else f"pictures of {self.image_size[0]}x{self.image_size[1]}"
        chunk = f"{self.executed} action(s) from step(s) {list(self.offsets)}"
        return f"{self.source.label} ({self.source.type}, {size}, {chunk})"

    def metadata(self) -> dict[str, Any]:
        """What a client needs to know, in plain values of msgpack and JSON."""
        from robocasa_lerobot import __version__

        source = self.source
        return {
            "server": "robocasa_lerobot",
            "version": __version__,
            "policy": {
                "label": source.label,
                "type": source.type,
                "fingerprint": source.fingerprint,
                "experiment": source.experiment,
                "phase": source.phase,
                "step": source.step,
            },
            "robot": contract.ROBOT_TYPE,
            "fps": contract.CONTROL_HZ,
            "action_horizon": self.horizon,
            "executed_steps": self.executed,
            "history_offsets": list(self.offsets),
            "cameras": list(self.cameras),
            "image_size": None if self.image_size is None else list(self.image_size),
            "state_parts": [[part.name, part.size] for part in contract.STATE_PARTS],
            "action_parts": [[part.name, part.size] for part in contract.ACTION_PARTS],
            "action_parts_hdf5": [[part.name, part.size] for part in contract.ACTION_PARTS_HDF5],
            "batch_width": self.width,
            "accepts": ["seed", "number", "reset"],
        }


@dataclass(frozen=True)
class Work:
    """A request of a client's session."""

    session: Session
    request: ChunkRequest


class ServedPolicy:
    """Answers requests of several sessions; called from one thread alone.

    Policies whose chunk follows from the request are computed in batches. The others (LeRobot's with queues of their
    own, and the reference policies) act step by step: each session has its own queues, on weights that all share.
    """

    def __init__(self, served: Served, chunks: ChunkPolicy | None, make_actor: Callable[[], Actor] | None) -> None:
        assert (chunks is None) != (make_actor is None), "a policy answers in chunks or steps"
        self.served = served
        self._chunks, self._make_actor = chunks, make_actor

    def answer(self, works: Sequence[Work]) -> list[Answer]:
        """Actions (executed, 12) in stored order of each request, or what went wrong with it.

        Raises:
            BatchingError: the policy can serve nobody: its actions depend on who shares a batch.
        """
        if self._chunks is None:
            return [self._step(work) for work in works]
        try:
            replies = self._chunks.predict([work.request for work in works])
        except BatchingError:
            raise
        except Exception as error:
            # Only the one that is at fault is to fail.
            return [error] if len(works) == 1 else [self.answer([work])[0] for work in works]
        return [reply.actions for reply in replies]

    def _step(self, work: Work) -> Answer:
        try:
            return self._acted(work)
        except Exception as error:
            work.session.actor = None
            return error

    def _acted(self, work: Work) -> NDArray[np.float32]:
        session, request = work.session, work.request
        trial = session.actor
        if trial is None or trial.seed != request.seed or request.number == 0:
            if request.number != 0:
                raise RequestError(
                    f"number: found {request.number} first; this policy remembers earlier steps, so that a trial's "
                    "requests come in order from 0, one for each control step."
                )
            assert self._make_actor is not None
            actor = self._make_actor() if trial is None else trial.actor
            with _noise_of(None):
                actor.reset(request.seed, None)
                session.actor = trial = _Trial(actor, request.seed, _noise_state())
        if request.number != trial.number:
            raise RequestError(f"number: found {request.number}, expected {trial.number}: this policy takes each step.")
        trial.number += 1
        with _noise_of(trial.noise):
            action = trial.actor.act(_batched(request.observations[-1]), request.instruction)
            trial.noise = _noise_state()
        return np.asarray(action, dtype=np.float32).reshape(1, contract.ACTION_SIZE)


@dataclass
class _Trial:
    """A session's actor in its trial: seed, state of torch's generators, number of the next step."""

    actor: Actor
    seed: int
    noise: list[Any]
    number: int = 0


class _noise_of:  # noqa: N801 (a context manager, used as a function)
    """Within it torch's generators are a trial's own; None leaves them as they are, to be seeded."""

    def __init__(self, state: list[Any] | None) -> None:
        self._state, self._before = state, list[Any]()

    def __enter__(self) -> None:
        self._before = _noise_state()
        if self._state is not None:
            _set_noise(self._state)

    def __exit__(self, *_: object) -> None:
        _set_noise(self._before)


def _noise_state() -> list[Any]:
    if "torch" not in sys.modules:  # `random` and `zero` do without
        return []
    import torch

    gpu = torch.cuda.get_rng_state_all() if torch.cuda.is_available() and torch.cuda.is_initialized() else []
    return [torch.get_rng_state(), *gpu]


def _set_noise(state: list[Any]) -> None:
    if not state:
        return
    import torch

    torch.set_rng_state(state[0])
    if len(state) > 1:
        torch.cuda.set_rng_state_all(state[1:])


def _batched(observation: dict[str, Any]) -> dict[str, Any]:
    """As an env gives it: writable, which torch asks for."""
    return {
        "pixels": {camera: np.array(picture) for camera, picture in observation["pixels"].items()},
        "agent_pos": np.array(observation["agent_pos"]),
    }


def load_served(
    source: PolicySource,
    device: str = "auto",
    executed_steps: int | None = None,
    width: int = 0,
    threads: int = 1,
    runtime: str = "onnx",
) -> ServedPolicy:
    """Load a policy to be served.

    Args:
        source: checkpoint, `random` or `zero`.
        device: auto, cpu, cuda, mps or one such as cuda:1.
        executed_steps: executed steps of each chunk; the policy's own if None.
        width: observations that are computed at once; 0: as an evaluation chooses it.
        threads: CPU threads.
        runtime: see `LoadedCheckpoint`.

    Raises:
        UserError: a reference policy that acts on what only the simulator knows; see also `LoadedCheckpoint`.
    """
    if source.is_reference:
        if source.type not in ("random", "zero"):
            raise UserError(
                f"policy.path {source.path}: it acts on the simulator's own state, which no client sends; serve a "
                "checkpoint, random or zero."
            )
        if executed_steps not in (None, 1):
            raise UserError(f"executed_steps={executed_steps} does not fit {source.type}: it acts step by step.")
        return ServedPolicy(Served(source, (), 1, (0,), 1), None, lambda: load_reference(source))
    import torch

    torch.set_num_threads(threads)
    device = pick_device(device)
    loaded = LoadedCheckpoint(source, device, executed_steps, runtime)
    config = json.loads((Path(source.path) / "config.json").read_text(encoding="utf-8"))
    cameras = tuple(filled_cameras(config, Path(source.path)))
    if not ChunkPolicy.serves(loaded):
        if executed_steps is not None:
            raise UserError(
                f"policy.path {source.path}: a policy of type {source.type!r} keeps observations or actions of earlier "
                "steps and answers step by step: leave --executed-steps out."
            )
        return ServedPolicy(Served(source, cameras, 1, (0,), 1), None, lambda: StepPolicy(_fork(loaded)))
    width = width or default_width([source.type], device)
    chunks = ChunkPolicy(loaded, width)
    horizon = next((int(getattr(loaded.config, n)) for n in ("horizon", "chunk_size") if hasattr(loaded.config, n)), 0)
    shape = chunks.shape
    return ServedPolicy(
        Served(source, cameras, shape.executed, shape.offsets, max(horizon, shape.executed), width), chunks, None
    )


def _fork(loaded: LoadedCheckpoint) -> LoadedCheckpoint:
    """The same weights with queues of its own."""
    shared = {id(tensor): tensor for tensor in (*loaded.policy.parameters(), *loaded.policy.buffers())}
    out = copy.copy(loaded)
    out.policy = copy.deepcopy(loaded.policy, shared)
    out.pre, out.post = copy.deepcopy(loaded.pre), copy.deepcopy(loaded.post)
    return out
