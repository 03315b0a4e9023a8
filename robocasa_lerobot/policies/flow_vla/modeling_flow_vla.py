"""The policy `flow_vla`: loss, sampling of action chunks, and stepping through them in an env."""

from __future__ import annotations

import copy
from collections import deque
from pathlib import Path
from typing import Any

import torch
from lerobot.policies.common.flow_matching import euler_integrate
from lerobot.policies.pretrained import PreTrainedPolicy
from lerobot.utils.constants import OBS_STATE
from torch import Tensor

from robocasa_lerobot.policies.common.chunks import (
    Generators,
    beta_times,
    decay_groups,
    normal_noise,
    sample_losses,
    starting_noise,
    target_actions,
    trained_by_name,
)
from robocasa_lerobot.policies.common.state import StateInput
from robocasa_lerobot.policies.common.traced import Traced
from robocasa_lerobot.policies.common.transfer import to_device
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.policies.flow_vla.expert import ActionExpert, PrefixCache, expert_context
from robocasa_lerobot.policies.flow_vla.prefix import Prefix, ScratchPrefix
from robocasa_lerobot.policies.flow_vla.pretrained import PretrainedPrefix


class FlowVlaPolicy(PreTrainedPolicy):
    """A LeRobot policy; its batches come from its preprocessor and its actions go to its postprocessor."""

    config_class = FlowVlaConfig
    name = "flow_vla"

    def __init__(self, config: FlowVlaConfig, **_: Any) -> None:
        super().__init__(config)
        config.validate_features()
        assert config.action_feature is not None
        self.config = config
        self.action_dim = config.action_feature.shape[0]
        self.state = StateInput(config)
        self.prefix: Prefix = ScratchPrefix(config) if config.prefix == "scratch" else PretrainedPrefix(config)
        self.prefix.freeze()
        self.expert = ActionExpert(
            state_dim=self.state.size,
            action_dim=self.action_dim,
            width=config.expert_width,
            hidden=round(config.expert_width * config.expert_mlp_ratio),
            adaptive=config.time_conditioning == "adaptive_norm",
            periods=(config.time_min_period, config.time_max_period),
            **self.prefix.shape,
        )
        self._ask_expert = Traced(self.expert)
        self.reset()

    def get_optim_params(self) -> list[dict[str, Any]] | dict[str, torch.nn.Parameter]:
        """Parameter groups: matrices of linear layers, and the rest, which does not decay.

        For `muon`, which goes by names, the parameters by their names.
        """
        if self.config.optimizer_name == "muon":
            return trained_by_name(self)
        decayed, rest = decay_groups(self)
        groups: list[dict[str, Any]] = [{"params": decayed}, {"params": rest, "weight_decay": 0.0}]
        return [group for group in groups if group["params"]]

    def forward(
        self,
        batch: dict[str, Tensor],
        reduction: str = "mean",
        generator: torch.Generator | None = None,
        noise: Tensor | None = None,
        times: Tensor | None = None,
    ) -> tuple[Tensor, dict[str, Any]]:
        """Loss of a batch: mean squared error of the velocity.

        Args:
            batch: cameras (B, 3, H, W), state (B, S), language tokens, `action` (B, chunk_size, A) and, for the mask,
                `action_is_pad`.
            reduction: `mean` gives a scalar, `none` the loss of each sample (B,).
            generator: for crops, noise and times; None uses the global one.
            noise: (B * noise_draws, chunk_size, A), drawn where None.
            times: (B * noise_draws,) in [0, 1], drawn where None.

        Returns:
            The loss, and scalars to log.
        """
        draws = self.config.noise_draws
        actions = target_actions(batch, self.config.chunk_size, self.action_dim, draws)
        prefix = self.prefix(batch, generator).repeated(draws)
        state = self._state(batch).repeat_interleave(draws, dim=0)
        if noise is None:
            noise = normal_noise(actions.shape, generator, actions)
        if times is None:
            times = to_device(self.sample_times(actions.shape[0], generator), actions.device)
        t = times[:, None, None]
        velocity = self.velocity(state, t * noise + (1.0 - t) * actions, times, prefix)
        losses = sample_losses(velocity, noise - actions, batch, self.config)
        return (losses if reduction == "none" else losses.mean()), {}

    def sample_times(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Training times (count,) on the CPU: of Beta(time_alpha, 1), brought into [time_smallest, 1]."""
        smallest = self.config.time_smallest
        return smallest + (1.0 - smallest) * beta_times(count, self.config.time_alpha, generator)

    def velocity(self, state: Tensor, noisy: Tensor, times: Tensor, prefix: PrefixCache) -> Tensor:
        """The predicted velocity (B, T, A), in float32; see `ActionExpert.forward`."""
        return self.expert(state, noisy, times, *self._context(prefix)).float()

    @torch.no_grad()
    def predict_action_chunk(
        self, batch: dict[str, Tensor], noise: Tensor | None = None, generator: Generators = None, **_: Any
    ) -> Tensor:
        """Sample the actions to execute from now on; a function of its arguments and the weights only.

        Args:
            batch: the newest observation, as the preprocessor gives it.
            noise: what integration starts from, (B, chunk_size, A); drawn where None.
            generator: one for the batch, or one per sample, so that a sample's actions do not depend on the batch
                it is in; None uses the global one.

        Returns:
            (B, n_action_steps, A), still normalised.
        """
        return self.sample(batch, noise, generator)[:, : self.config.n_action_steps]

    @torch.no_grad()
    def sample(
        self,
        batch: dict[str, Tensor],
        noise: Tensor | None = None,
        generator: Generators = None,
        cached_prefix: bool = True,
    ) -> Tensor:
        """All predicted actions, (B, chunk_size, A), by Euler steps from noise. Arguments as above.

        Without `cached_prefix` the prefix is read anew in each step: slower, the same actions; for comparison.
        """
        if self.training:  # asked, because telling all modules takes milliseconds
            self.eval()
        state = self._state(batch)
        x = starting_noise(noise, (state.shape[0], self.config.chunk_size, self.action_dim), generator, state)
        context = self._context(self.prefix(batch)) if cached_prefix else None

        def velocity(noisy: Tensor, times: Tensor) -> Tensor:
            return self._ask_expert(state, noisy, times, *(context or self._context(self.prefix(batch)))).float()

        return euler_integrate(velocity, x, self.config.num_inference_steps)

    def reset(self) -> None:
        """Forget planned actions; called at the start of an episode."""
        self._planned: deque[Tensor] = deque()

    @property
    def needs_observation(self) -> bool:
        """Whether the next `select_action` looks at its observation."""
        return not self._planned

    @torch.no_grad()
    def select_action(
        self, batch: dict[str, Tensor], noise: Tensor | None = None, generator: Generators = None, **_: Any
    ) -> Tensor:
        """The next action (B, A), normalised: of the planned chunk, or of a new one where that is used up.

        Args:
            batch: the newest observation; ignored where `needs_observation` is false.
            noise: as for `predict_action_chunk`, used when a chunk is sampled.
            generator: likewise.
        """
        if not self._planned:
            self._planned.extend(self.predict_action_chunk(batch, noise=noise, generator=generator).unbind(dim=1))
        return self._planned.popleft()

    def _context(self, prefix: PrefixCache) -> list[Tensor]:
        return expert_context(prefix, self.config.chunk_size, self.prefix.rotary, like=self.expert.head.weight)

    def _state(self, batch: dict[str, Tensor]) -> Tensor:
        state = batch[OBS_STATE].float()
        chosen: Tensor = self.state(state.squeeze(1) if state.ndim == 3 else state)
        return chosen

    def _get_default_peft_targets(self) -> dict[str, Any]:
        """LoRA on the attention of prefix and expert; what joins them to states and actions is trained in full."""
        return {
            "target_modules": r".*\.(q_proj|k_proj|v_proj|o_proj)",
            "modules_to_save": ["embed_state", "embed_action", "time_mlp", "head"],
        }

    def _save_pretrained(self, save_directory: Path, state_dict: dict[str, Tensor] | None = None) -> None:
        """Weights and configuration, with what builds the prefix: a checkpoint needs no other file."""
        super()._save_pretrained(save_directory, state_dict=state_dict)
        config = copy.copy(self.config)
        config.prefix_config = self.prefix.checkpoint_config()
        config._save_pretrained(save_directory)
