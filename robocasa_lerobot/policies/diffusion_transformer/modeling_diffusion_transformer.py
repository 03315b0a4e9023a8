"""The policy `diffusion_transformer`: loss, sampling of action chunks, and stepping through them in an env."""

from __future__ import annotations

from collections import deque
from typing import Any

import torch
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from diffusers.schedulers.scheduling_ddpm import DDPMScheduler
from lerobot.policies.pretrained import PreTrainedPolicy
from lerobot.utils.constants import OBS_LANGUAGE_ATTENTION_MASK, OBS_LANGUAGE_TOKENS, OBS_STATE
from torch import Tensor

from robocasa_lerobot.policies.common.attention import short_attention
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
from robocasa_lerobot.policies.common.look_back import LookBack
from robocasa_lerobot.policies.common.traced import Traced
from robocasa_lerobot.policies.common.transfer import to_device
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)
from robocasa_lerobot.policies.diffusion_transformer.look_ahead import LookAhead
from robocasa_lerobot.policies.diffusion_transformer.network import DenoisingTransformer
from robocasa_lerobot.policies.diffusion_transformer.observation import ObservationEncoder
from robocasa_lerobot.policies.diffusion_transformer.sampling import DdimSteps, sampling_times


class DiffusionTransformerPolicy(PreTrainedPolicy):
    """A LeRobot policy; its batches come from its preprocessor and its actions go to its postprocessor."""

    config_class = DiffusionTransformerConfig
    name = "diffusion_transformer"

    def __init__(self, config: DiffusionTransformerConfig, **_: Any) -> None:
        super().__init__(config)
        config.validate_features()
        assert config.action_feature is not None
        self.config = config
        self.action_dim = config.action_feature.shape[0]
        self.observation_encoder = ObservationEncoder(config)
        self.denoiser = DenoisingTransformer(
            action_dim=self.action_dim,
            feature_dim=self.observation_encoder.feature_dim,
            horizon=config.horizon,
            n_obs_steps=config.n_obs_steps,
            width=config.width,
            n_heads=config.n_heads,
            n_decoder_layers=config.n_decoder_layers,
            n_condition_layers=config.n_condition_layers,
            dropout_embedding=config.dropout_embedding,
            dropout=config.dropout,
        )
        self.look_ahead = (
            LookAhead(
                self.observation_encoder.feature_dim,
                config.width,
                self.action_dim,
                config.look_ahead,
                first=1 - config.n_obs_steps,
            )
            if config.look_ahead
            else None
        )
        self.scheduler = _noise_scheduler(config)
        self._condition, self._decode = Traced(self.denoiser, "condition"), Traced(self.denoiser, "decode")
        self._ddim: DdimSteps | None = None  # of the levels that were last asked for
        self._observed_keys = (*self.observation_encoder.image_keys, OBS_STATE)
        self.reset()

    def get_optim_params(self) -> list[dict[str, Any]] | dict[str, torch.nn.Parameter]:
        """Parameter groups: matrices of the transformer, its biases, norms and positions, and the encoders.

        For `muon`, which goes by names, the parameters by their names.
        """
        if self.config.optimizer_name == "muon":
            return trained_by_name(self)
        decayed, rest = decay_groups(self.denoiser)
        encoder = [p for p in self.observation_encoder.parameters() if p.requires_grad]
        if self.look_ahead is not None:
            encoder += self.look_ahead.parameters()
        groups: list[dict[str, Any]] = [
            {"params": decayed},
            {"params": rest, "weight_decay": 0.0},
            {"params": encoder, "weight_decay": self.config.optimizer_encoder_weight_decay},
        ]
        return [group for group in groups if group["params"]]

    def compile(self, *arguments: Any, **options: Any) -> None:
        """Have `torch.compile` translate the encoder, and the transformer layer by layer, with its own arguments.

        Layers are alike, so that one is translated for all of them.
        """
        for part in (self.observation_encoder, *self.denoiser.layers()):
            part.compile(*arguments, **options)

    def forward(
        self,
        batch: dict[str, Tensor],
        reduction: str = "mean",
        generator: torch.Generator | None = None,
        noise: Tensor | None = None,
        times: Tensor | None = None,
    ) -> tuple[Tensor, dict[str, Any]]:
        """Loss of a batch.

        Args:
            batch: observations (B, n_obs_steps, ...), of a single step also without that axis; `action` (B, L, A) at
                the config's `action_delta_indices`, whose first `horizon` are the chunk, and, for the mask,
                `action_is_pad`.
            reduction: `mean` gives a scalar, `none` the loss of each sample (B,).
            generator: for noise, diffusion times and crops; None uses the global one.
            noise: (B * noise_draws, horizon, A), drawn where None.
            times: diffusion steps (B * noise_draws,), drawn where None.

        Returns:
            The loss, and scalars to log.
        """
        draws = self.config.noise_draws
        if self.config.n_obs_steps == 1:  # LeRobot's datasets give a single picture without its time axis
            batch = self._with_time_axis(batch)
        observed = self.observation_encoder(batch, generator).float()
        features = observed.repeat_interleave(draws, dim=0)
        loaded = target_actions(batch, len(self.config.action_delta_indices), self.action_dim, draws)
        actions = loaded[:, : self.config.horizon]
        if noise is None:
            noise = normal_noise(actions.shape, generator, actions)
        if times is None:
            times = to_device(self.sample_times(actions.shape[0], generator), actions.device)
        noisy = self.scheduler.add_noise(actions, noise, times)
        target = noise if self.config.prediction_type == "epsilon" else actions
        with short_attention(actions.device):
            predicted = self.denoiser(noisy, times, features).float()
        losses = sample_losses(predicted, target, batch, self.config)
        told: dict[str, Any] = {}
        if self.look_ahead is not None:
            ahead = self.look_ahead(observed, batch)
            losses = losses + self.config.look_ahead_weight * ahead
            told["look_ahead_loss"] = ahead.mean().detach()
        return (losses if reduction == "none" else losses.mean()), told

    def sample_times(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Diffusion steps to train (count,), on the CPU: evenly, or by Beta(time_alpha, 1) more of the noisy ones."""
        steps, alpha = self.config.num_train_timesteps, self.config.time_alpha
        if alpha == 1.0:
            return torch.randint(steps, (count,), generator=generator)
        return (steps * beta_times(count, alpha, generator)).long().clamp(max=steps - 1)

    @torch.no_grad()
    def predict_action_chunk(
        self, batch: dict[str, Tensor], noise: Tensor | None = None, generator: Generators = None, **_: Any
    ) -> Tensor:
        """Sample the actions to execute from now on; a function of its arguments and the weights only.

        Args:
            batch: observations (B, n_obs_steps, ...); without the time axis they are taken for the first of an
                episode and repeated.
            noise: what denoising starts from, (B, horizon, A); drawn where None.
            generator: one for the batch, or one per sample, so that a sample's actions do not depend on the batch
                it is in; None uses the global one. DDPM also draws from it at each denoising step.

        Returns:
            (B, n_action_steps, A), still normalised.
        """
        chunk = self.sample(batch, noise, generator)
        start = self.config.n_obs_steps - 1
        return chunk[:, start : start + self.config.n_action_steps]

    @torch.no_grad()
    def sample(self, batch: dict[str, Tensor], noise: Tensor | None = None, generator: Generators = None) -> Tensor:
        """All predicted actions, (B, horizon, A), from offset 1 - n_obs_steps on. Arguments as above."""
        if self.training:  # asked, because telling all modules takes milliseconds
            self.eval()
        features = self.observation_encoder(self._with_time_axis(batch)).float()
        random = generator if generator is None or isinstance(generator, torch.Generator) else list(generator)
        shape = (features.shape[0], self.config.horizon, self.action_dim)
        x = starting_noise(noise, shape, generator, features)
        times = sampling_times(self.config)
        ddim = None
        if isinstance(self.scheduler, DDPMScheduler):
            self.scheduler.set_timesteps(timesteps=times)
        else:
            ddim = self._ddim_steps(times)
        # The conditions of all steps at once: they do not depend on the actions.
        asked = torch.tensor(times, device=x.device).repeat_interleave(shape[0])
        memory = self._condition(asked, features.repeat(len(times), 1, 1)).unflatten(0, (len(times), shape[0]))
        for number, time in enumerate(times):
            prediction = self._decode(x, memory[number]).float()
            if ddim is None:
                x = self.scheduler.step(prediction, time, x, generator=random).prev_sample
            else:
                x = ddim.step(number, prediction, x)
        return x

    def _ddim_steps(self, times: list[int]) -> DdimSteps:
        if self._ddim is None or self._ddim.times != tuple(times):
            self._ddim = DdimSteps(self.scheduler, times)
        return self._ddim

    def reset(self) -> None:
        """Forget observations and planned actions; called at the start of an episode."""
        self._planned: deque[Tensor] = deque()
        self._step = 0
        config = self.config
        self._back: LookBack[dict[str, Tensor]] = LookBack(config.observation_delta_indices, config.n_action_steps)

    @property
    def needs_observation(self) -> bool:
        """Whether the observation of the next `select_action` will be looked at, now or as the history of a chunk."""
        return self._back.sees(self._step)

    @torch.no_grad()
    def select_action(
        self, batch: dict[str, Tensor], noise: Tensor | None = None, generator: Generators = None, **_: Any
    ) -> Tensor:
        """The next action (B, A), normalised: of the planned chunk, or of a new one where that is used up.

        Args:
            batch: the newest observation, without time axis; ignored where `needs_observation` is false.
            noise: as for `predict_action_chunk`, used when a chunk is sampled.
            generator: likewise.
        """
        if self.needs_observation:
            self._back.note(self._step, {key: batch[key] for key in self._observed_keys})
        if not self._planned:
            steps = self._back.at(self._step)
            stacked = {key: torch.stack([step[key] for step in steps], dim=1) for key in self._observed_keys}
            for key in (OBS_LANGUAGE_TOKENS, OBS_LANGUAGE_ATTENTION_MASK):
                if key in batch:
                    stacked[key] = batch[key]
            chunk = self.predict_action_chunk(stacked, noise=noise, generator=generator)
            self._planned.extend(chunk.unbind(dim=1))
        self._step += 1
        return self._planned.popleft()

    def _with_time_axis(self, batch: dict[str, Tensor]) -> dict[str, Tensor]:
        """The batch with (B, n_obs_steps, ...) for what has no time axis, the same at all of them."""
        steps = self.config.n_obs_steps
        lacking = {k: batch[k] for k in self._observed_keys if batch[k].ndim < (3 if k == OBS_STATE else 5)}
        return {**batch, **{k: x.unsqueeze(1).expand(-1, steps, *x.shape[1:]) for k, x in lacking.items()}}


def _noise_scheduler(config: DiffusionTransformerConfig) -> DDPMScheduler | DDIMScheduler:
    shared = {
        "num_train_timesteps": config.num_train_timesteps,
        "beta_start": config.beta_start,
        "beta_end": config.beta_end,
        "beta_schedule": config.beta_schedule,
        "clip_sample": config.clip_sample,
        "clip_sample_range": config.clip_sample_range,
        "prediction_type": config.prediction_type,
        "timestep_spacing": config.timestep_spacing,
    }
    if config.noise_scheduler == "DDPM":
        return DDPMScheduler(variance_type="fixed_small", **shared)
    return DDIMScheduler(set_alpha_to_one=True, **shared)
