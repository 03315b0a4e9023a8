"""What a file of corrections is made from: the settings of a recording, the policy, and when it is taken over."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.corrections.takeover import Takeover
from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import LackingMachineError, UserError
from robocasa_lerobot.evaluation.actors.actor import Actor
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource, check_name, find_pretrained, read_source
from robocasa_lerobot.evaluation.records.results import REFERENCE_POLICIES, REPLAY

# Control steps: most demonstrations of the short tasks have ended by then, so that a policy that has not is astray.
AFTER_STEPS = (100, 250)
_TAKEOVER_STREAM, _POLICY_STREAM = 8, 9  # apart from those of scene, arm, noise, style and choice among sources


@dataclass(frozen=True)
class CorrectionSettings(RecordingSettings):
    """A recording in which a policy drives first; where it has solved the task alone, no step is corrected.

    Attributes:
        policy: a checkpoint's folder, or `random` or `zero`, as `eval --policy.path` takes it.
        fingerprint: what tells this policy from another, wherever it lies.
        after_steps: the demonstrator takes over after a number of control steps drawn between these two.
        device: that the policy computes on.
    """

    policy: str = ""
    fingerprint: str = ""
    after_steps: tuple[int, int] = AFTER_STEPS
    device: str = "cpu"

    @classmethod
    def of(cls, policy: str, **values: Any) -> CorrectionSettings:
        """With the policy looked at.

        Raises:
            CheckpointError: it is no checkpoint.
            UserError: it is none that can be corrected, or the steps are none that can be drawn between.
        """
        source = _source(policy)
        settings = cls(policy=policy, fingerprint=source.fingerprint, **values)
        low, high = settings.after_steps
        if not 0 < low <= high:
            raise UserError(f"--after {low},{high}: expected two numbers of control steps, the smaller first, from 1.")
        size = settings.picture_size
        if settings.images and settings.image_size != size:
            raise UserError(
                f"--image-size is {settings.image_size}, but {policy} sees {size} pixels, and an episode has pictures "
                f"of one size. Give --image-size {size}, or leave --images out and let `convert` draw any size."
            )
        return settings

    @property
    def source(self) -> PolicySource:
        """The policy as it describes itself."""
        return _source(self.policy)

    @property
    def picture_size(self) -> int:
        """Pixels of a side of the pictures that the policy sees."""
        size = self.source.image_size
        if size is not None and size[0] != size[1]:
            raise UserError(f"{self.policy} sees pictures of {size[0]}x{size[1]} pixels; the kitchens' are square.")
        return contract.IMAGE_SIZE if size is None else size[0]

    def identity(self) -> dict[str, Any]:
        """What attempts depend on: the policy itself, wherever it lies."""
        return {key: value for key, value in super().identity().items() if key not in ("policy", "device")}

    def check_ready(self) -> None:
        """Whether the policy is the one that this began with, and can be loaded: no other attempt would load it.

        Raises:
            LackingMachineError: it is another one, or not there.
            UserError: it does not load, or there is no such device.
        """
        try:
            found = self.source.fingerprint
        except UserError as error:
            raise LackingMachineError(f"the policy is not there any more: {error}") from error
        if found != self.fingerprint:
            raise LackingMachineError(
                f"{self.policy} is another policy than when this began. With that one in place the same command goes "
                "on; what corrects this one needs another --out."
            )
        _actor(self.source, self.device)

    def attempt_kwargs(self) -> dict[str, Any]:
        """The policy's pictures, and time for both."""
        return {"image_size": self.picture_size, "horizon": get_task(self.task).horizon + self.after_steps[1]}

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        """Make the attempt of a seed; who decided each step, and what the policy asked for, stand beside it."""
        low, high = self.after_steps
        after = int(np.random.default_rng([seed, _TAKEOVER_STREAM]).integers(low, high + 1))
        noise = int(np.random.SeedSequence([seed, _POLICY_STREAM]).generate_state(1)[0])
        takeover = Takeover(_actor(self.source, self.device), noise, after)
        recording = self.labelled_episode(env, seed, takeover.act)
        corrected = np.array(takeover.corrected[: len(recording.actions)], dtype=np.uint8).reshape(-1, 1)
        wanted = recording.per_step.get(contract.CLEAN_ACTION, recording.actions)
        recording.per_step[contract.INTERVENTION] = corrected
        # Where the policy was not asked, its place has what was carried out: no number that is none.
        recording.per_step[contract.POLICY_ACTION] = np.where(corrected > 0, recording.actions, wanted)
        recording.ep_meta["correction"] = {
            "policy": self.source.label,
            "fingerprint": self.fingerprint,
            "after_steps": after,
            "corrected_steps": int(corrected.sum()),
        }
        return recording


def parse_after(text: str) -> tuple[int, int]:
    """`100,250`, or one number for both.

    Raises:
        ValueError: it is written otherwise.
    """
    numbers = [int(part) for part in text.split(",")]
    if len(numbers) not in (1, 2):
        raise ValueError(text)
    return numbers[0], numbers[-1]


def _source(policy: str) -> PolicySource:
    if policy in REFERENCE_POLICIES or policy.startswith(f"{REPLAY}:"):
        source = read_source(policy)
    else:
        check_name(policy)
        folder = find_pretrained(Path(policy)).resolve()  # `last` may become another folder
        source = _read(policy, folder, max(file.stat().st_mtime_ns for file in folder.iterdir()))
    if source.type in (REPLAY, "demonstrator"):
        raise UserError(f"--policy {policy}: there is nothing to correct. Give a checkpoint's folder.")
    return source


@lru_cache(maxsize=8)
def _read(policy: str, folder: Path, changed_ns: int) -> PolicySource:
    """What a checkpoint says of itself, and a hash of its weights, which may be gigabytes: once for each change."""
    return read_source(policy)


@lru_cache(maxsize=1)
def _actor(source: PolicySource, device: str) -> Actor:
    """The policy, kept by a process from one attempt to the next; on one thread, as sums depend on their number."""
    from robocasa_lerobot.evaluation.actors.policy_runner import load_actor, pick_device

    if source.is_checkpoint:
        import torch

        torch.set_num_threads(1)
    with contextlib.redirect_stdout(None):  # LeRobot tells of every file that it reads
        return load_actor(source, pick_device(device) if source.is_checkpoint else "cpu", None)
