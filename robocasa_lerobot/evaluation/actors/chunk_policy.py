"""A LeRobot checkpoint as a function from requests to action chunks, computed in batches of one fixed width.

Sums of floats depend on the size of the batch, so that a trial would turn out differently if others
share its batch. Here every batch has the same width, the last one filled up with copies, and the noise of each sample
comes from a generator of its own. On a CPU even the place within a batch matters (vector instructions take another path
at the ends of an array), so that the width is 1 there; with a greater one, the first batches are computed twice, with
the samples in other places, and a difference ends the run. docs/decisions/0018-evaluation-batches.md has the
measurements.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import ChunkReply, ChunkRequest, ChunkShape, chunk_seed
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource, has_queues

GPU_BATCH_WIDTH = 8
# LeRobot's own types whose chunks follow from one observation; the others keep observations in queues of their own.
STATELESS_TYPES = frozenset({"act", "groot", "pi0", "pi05", "smolvla", "xvla"})
_WITHOUT_NOISE = "act"
_WHOLE_CHUNKS = (
    "groot"  # its actions may be relative to the state at the chunk's start, and scaled by their place in it
)


def default_width(kinds: Iterable[str], device: str) -> int:
    """Observations that policies of these types compute at once: 1 on a CPU, and where noise is drawn for a batch."""
    from robocasa_lerobot.policies.registry import POLICY_TYPES

    each_alone = all(kind in (*POLICY_TYPES, _WITHOUT_NOISE) for kind in kinds)
    return GPU_BATCH_WIDTH if device != "cpu" and each_alone else 1


def can_be_frozen(kinds: Iterable[str], device: str) -> bool:
    """Whether policies of any of these types are computed by ONNX Runtime, if that is wished."""
    from robocasa_lerobot.policies.registry import POLICY_TYPES

    return device == "cpu" and not set(POLICY_TYPES).isdisjoint(kinds)


def observation_offsets(config: Any) -> tuple[int, ...]:
    """Control steps at which a policy with this configuration looks, ascending up to 0."""
    chosen = getattr(config, "observation_offsets", None)
    return tuple(chosen) if chosen else tuple(range(1 - int(getattr(config, "n_obs_steps", 1)), 1))


class BatchingError(UserError):
    """A policy's actions are no function of the request: they depend on others, or come in other numbers."""


class ChunkPolicy:
    """A loaded checkpoint; `predict` may be called with any number of requests.

    Args:
        loaded: policy, processors and configuration.
        width: samples of a batch.

    Raises:
        UserError: a width above 1 for a policy that takes no generator for each sample.
    """

    def __init__(self, loaded: LoadedCheckpoint, width: int) -> None:
        self._loaded, self._width = loaded, width
        self._checked: set[bool] = set()
        config = loaded.config
        offsets = observation_offsets(config)
        self._history = len(offsets)
        # GR00T's own weights may say that fewer actions are executed than its settings ask for.
        executed = getattr(loaded.policy, "_action_queue_steps", config.n_action_steps)
        self.shape = ChunkShape(executed=int(executed), offsets=offsets)
        parameters = inspect.signature(loaded.policy.predict_action_chunk).parameters
        self._takes_generators = "generator" in parameters
        self._whole_chunks = config.type == _WHOLE_CHUNKS  # draccus looks a type up in its registry each time
        if width > 1 and not self._takes_generators and config.type != _WITHOUT_NOISE:
            raise UserError(
                f"policy.batch_width={width}: policies of type {config.type!r} draw their noise for a whole batch, so "
                "that a trial would depend on the others; use --policy.batch_width=1."
            )

    @staticmethod
    def serves(loaded: LoadedCheckpoint) -> bool:
        """Whether the chunks of this policy follow from its last observations alone."""
        parameters = inspect.signature(loaded.policy.predict_action_chunk).parameters
        return "generator" in parameters or (
            loaded.config.type in STATELESS_TYPES and not has_queues(vars(loaded.config))
        )

    def predict(self, requests: Sequence[ChunkRequest]) -> list[ChunkReply]:
        """The chunk of each request, `width` at a time.

        Raises:
            BatchingError: found on the first batch, and on the first one of different requests.
        """
        out: list[ChunkReply] = []
        for start in range(0, len(requests), self._width):
            group = list(requests[start : start + self._width])
            began = time.perf_counter()
            full = group + [group[0]] * (self._width - len(group))
            chunks = self._batch(full)
            self._check_places(full, len(group) > 1, chunks)
            share = (time.perf_counter() - began) / len(group)
            out += [ChunkReply(chunks[i], share) for i in range(len(group))]
        return out

    def _check_places(self, full: list[ChunkRequest], mixed: bool, chunks: NDArray[np.float32]) -> None:
        if self._width == 1 or mixed in self._checked:
            return
        self._checked.add(mixed)
        moved = np.roll(self._batch(full[-1:] + full[:-1]), -1, axis=0)
        alike = mixed or bool((chunks == chunks[:1]).all())
        if not (alike and np.array_equal(chunks, moved)):
            raise BatchingError(
                f"policy.batch_width={self._width}: on {self._loaded.config.device} this policy's actions depend on "
                "the place of an observation in its batch, so that a trial would depend on others; use "
                "--policy.batch_width=1."
            )

    def _batch(self, group: list[ChunkRequest]) -> NDArray[np.float32]:
        import torch
        from lerobot.envs.utils import preprocess_observation

        loaded, count = self._loaded, len(group)
        flat = [observation for request in group for observation in request.observations]
        batch = preprocess_observation(_stacked(flat))
        batch["task"] = [request.instruction for request in group for _ in request.observations]
        batch = loaded.pre(batch)
        if self._history > 1:
            batch = {key: self._with_time(key, value, count) for key, value in batch.items()}
        seeds = [chunk_seed(request.seed, request.number) for request in group]
        arguments: dict[str, Any] = {}
        if self._takes_generators:
            # On the CPU whatever the device: the same noise everywhere.
            arguments["generator"] = [torch.Generator().manual_seed(seed) for seed in seeds]
        else:
            torch.manual_seed(seeds[0])
        with torch.inference_mode():
            chunk = loaded.policy.predict_action_chunk(batch, **arguments)[:, : self.shape.executed]
            if chunk.shape[1] != self.shape.executed:
                raise BatchingError(
                    f"a policy of type {loaded.config.type!r} predicts {chunk.shape[1]} actions at once, and "
                    f"{self.shape.executed} are to be executed: use --executed_steps={chunk.shape[1]} or fewer."
                )
            if self._whole_chunks:
                actions = loaded.post(chunk)
            else:
                actions = loaded.post(chunk.reshape(-1, chunk.shape[-1])).reshape(count, chunk.shape[1], -1)
        return np.asarray(actions.to("cpu").float().numpy(), dtype=np.float32)

    def _with_time(self, key: str, value: Any, count: int) -> Any:
        import torch

        if not isinstance(value, torch.Tensor) or value.ndim == 0 or value.shape[0] != count * self._history:
            return value
        steps = value.reshape(count, self._history, *value.shape[1:])
        return steps[:, -1] if "language" in key else steps


def _stacked(observations: Sequence[Any]) -> Any:
    """Observations of one structure, array by array."""
    first = observations[0]
    if isinstance(first, dict):
        return {name: _stacked([one[name] for one in observations]) for name in first}
    return np.stack(observations)


class LoadedCheckpoint:
    """Policy, processors and configuration of a checkpoint, on a device.

    Args:
        source: the checkpoint.
        device: where it computes.
        executed_steps: actions of each chunk that are carried out; the policy's own if None.
        runtime: `onnx` has ONNX Runtime compute what it can (`can_be_frozen`): the weights are not to change; `torch`.

    Raises:
        UserError: the policy's type is not registered, or `executed_steps` does not fit it.
    """

    def __init__(self, source: PolicySource, device: str, executed_steps: int | None, runtime: str = "onnx") -> None:
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        from robocasa_lerobot.policies.common.traced import freeze
        from robocasa_lerobot.policies.registry import register_policy_type
        from robocasa_lerobot.settings import user_error_in

        register_policy_type(source.type)
        overrides = [] if executed_steps is None else [f"--n_action_steps={executed_steps}"]
        try:
            config = PreTrainedConfig.from_pretrained(source.path, cli_overrides=overrides)
        except (Exception, SystemExit) as error:
            reason = user_error_in(error) or error
            what = (
                "its config cannot be read"
                if executed_steps is None
                else f"executed_steps={executed_steps} does not fit"
            )
            raise UserError(f"policy {source.path}: {what}: {reason}") from error
        config.device = device
        config.pretrained_path = source.path
        self.config: Any = config
        self.policy: Any = get_policy_class(config.type).from_pretrained(source.path, config=config)
        self.policy.to(device).eval()
        if runtime == "onnx" and can_be_frozen([config.type], device):
            freeze(self.policy)
        self.pre, self.post = make_pre_post_processors(
            policy_cfg=config,
            pretrained_path=source.path,
            preprocessor_overrides={"device_processor": {"device": device}},
        )
