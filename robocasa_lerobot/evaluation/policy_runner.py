"""Policies as a trial sees them: reset with a noise seed, then one action for each observation."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.checkpoints import PolicySource
from robocasa_lerobot.settings import user_error_in

Observation = dict[str, Any]


class PolicyRunner(Protocol):
    """One policy in one process, for one trial at a time; `device` is where it computes."""

    device: str

    def reset(self, seed: int) -> None:
        """Forget the last trial; `seed` fixes all sampling noise of the next one."""

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The action of shape (12,) in stored order for an observation of the env."""

    def sees(self, step: int) -> bool:
        """Whether the pictures of the observation that action `step` (from 0) answers to can matter."""


class ZeroPolicy:
    """Every component zero: the arm holds still, the gripper opens."""

    device = "cpu"

    def reset(self, seed: int) -> None:
        """Nothing to forget."""

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """Zeros."""
        return np.zeros(contract.ACTION_SIZE, dtype=np.float32)

    def sees(self, step: int) -> bool:
        """Never looks."""
        return False


class RandomPolicy:
    """Actions uniform in [-1, 1], independent at each step."""

    device = "cpu"

    def __init__(self) -> None:
        self._rng = np.random.default_rng(0)

    def reset(self, seed: int) -> None:
        """Start the stream of this trial."""
        self._rng = np.random.default_rng(seed)

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """A uniform sample."""
        return self._rng.uniform(-1.0, 1.0, contract.ACTION_SIZE).astype(np.float32)

    def sees(self, step: int) -> bool:
        """Never looks."""
        return False


class CheckpointPolicy:
    """A LeRobot checkpoint with its processors, run as `lerobot-eval` runs it.

    Order: `preprocess_observation` -> task -> preprocessor -> `select_action` -> postprocessor. The process's torch
    generator is seeded at each reset: a worker runs one trial at a time, so that a trial draws the same noise
    whatever ran before it.

    Raises:
        UserError: the policy's type is not registered, or `executed_steps` does not fit it.
    """

    def __init__(self, source: PolicySource, device: str, executed_steps: int | None) -> None:
        # Heavy imports; a worker that only runs reference policies never pays for them.
        import torch
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.envs.utils import preprocess_observation
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        register_policy_type(source.type)
        self._torch, self._preprocess_observation = torch, preprocess_observation
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
        self.device = config.device = pick_device(device)
        config.pretrained_path = source.path
        self._policy = get_policy_class(config.type).from_pretrained(source.path, config=config)
        self._policy.to(config.device).eval()
        self._pre, self._post = make_pre_post_processors(
            policy_cfg=config,
            pretrained_path=source.path,
            preprocessor_overrides={"device_processor": {"device": config.device}},
        )
        self._executed = getattr(config, "n_action_steps", None)
        self._history = int(getattr(config, "n_obs_steps", 1))

    def reset(self, seed: int) -> None:
        """Clear the policy's queues and seed its sampling noise."""
        self._torch.manual_seed(seed)
        self._policy.reset()
        self._pre.reset()
        self._post.reset()

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The policy's next action."""
        batch = self._preprocess_observation(observation)
        batch["task"] = [instruction]
        batch = self._pre(batch)
        with self._torch.inference_mode():
            action = self._post(self._policy.select_action(batch))
        return action.to("cpu").numpy()[0].astype(np.float32)

    def sees(self, step: int) -> bool:
        """Whether step `step` is among the last `n_obs_steps` up to a step at which a chunk is predicted."""
        if not self._executed:
            return True
        return (-step) % self._executed < self._history


def load_policy(source: PolicySource, device: str, executed_steps: int | None) -> PolicyRunner:
    """The runner of a policy source.

    Raises:
        UserError: see `CheckpointPolicy`.
    """
    if source.path == "zero":
        return ZeroPolicy()
    if source.path == "random":
        return RandomPolicy()
    return CheckpointPolicy(source, device, executed_steps)


def register_policy_type(kind: str) -> None:
    """Import what registers policy type `kind` with LeRobot: ours by its name, else installed plugins."""
    from lerobot.configs.policies import PreTrainedConfig

    from robocasa_lerobot.policies.registry import POLICY_TYPES, register_policies

    if kind in POLICY_TYPES:
        register_policies()
    if kind not in PreTrainedConfig.get_known_choices():
        from lerobot.utils.import_utils import register_third_party_plugins

        register_third_party_plugins()
    if kind not in PreTrainedConfig.get_known_choices():
        known = ", ".join(sorted(PreTrainedConfig.get_known_choices()))
        raise UserError(f"policy type {kind!r} is not registered; known: {known}. Install the package that has it.")


def pick_device(device: str) -> str:
    """`auto` resolved to cuda where there is one, else cpu.

    Raises:
        UserError: a device that this machine does not have.
    """
    import torch

    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cuda" and not torch.cuda.is_available():
        raise UserError("policy.device=cuda, but torch sees no GPU: use --policy.device=cpu.")
    return device
