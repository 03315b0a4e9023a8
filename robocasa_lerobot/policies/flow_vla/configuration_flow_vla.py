"""Configuration of the policy type `flow_vla`.

Time runs as in pi0 (Black et al. 2024): t = 1 is noise, t = 0 is data, x_t = t * noise + (1 - t) * actions, and the
network predicts the velocity noise - actions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.optim import CosineDecayWithWarmupSchedulerConfig, DiffuserSchedulerConfig, LRSchedulerConfig

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.policies.common.configuration import ActionChunkConfig

PREFIXES = ("scratch", "pretrained")
TIME_CONDITIONINGS = ("mlp", "adaptive_norm")
FROZEN_DTYPES = ("float32", "bfloat16")
SCRATCH_IMAGE_SIZE = (128, 128)


@PreTrainedConfig.register_subclass("flow_vla")
@dataclass
class FlowVlaConfig(ActionChunkConfig):
    """Fields of the policy beside the common ones; lengths in control steps."""

    # Time. `chunk_size` actions are predicted from now on, the first `n_action_steps` of them are executed.
    n_obs_steps: int = 1
    chunk_size: int = 50
    n_action_steps: int = 10  # half a second; the benchmark executes 5 of pi0's 50

    state_clip: float | None = 5.0

    # Images: after the crop they are brought back to `image_size`. Null is what the pretrained vision model takes, and
    # 128x128 from scratch.
    crop_fraction: float = 0.95

    # Prefix: what reads pictures and instruction. `scratch`: a small vision transformer and hashed words, trained
    # with the policy, no download. `pretrained`: a vision-language model of `transformers` (SmolVLM, PaliGemma).
    prefix: str = "scratch"
    prefix_path: str = "HuggingFaceTB/SmolVLM2-500M-Video-Instruct"  # hub name or folder, of `pretrained`
    prefix_layers: int | None = None  # of `pretrained`: only the first layers of its language model; null: all
    prefix_config: dict[str, Any] | None = None  # written into checkpoints, which then need `prefix_path` no more
    max_tokens: int = 48  # of `pretrained`: instructions are cut to this many tokens
    freeze_vision: bool = False  # vision model and what joins it to the language model; both stay in eval mode
    freeze_language: bool = False  # language model and its word embeddings; likewise
    frozen_dtype: str = "float32"  # what frozen parts are held in; bfloat16 halves their memory

    # Prefix from scratch: strided convolutions, one stride of 2 each, then transformers over patches and over all.
    vision_channels: list[int] = field(default_factory=lambda: [32, 64, 128, 256])
    vision_layers: int = 2
    prefix_width: int = 256
    prefix_depth: int = 6
    prefix_heads: int = 8
    prefix_kv_heads: int = 2
    prefix_head_dim: int = 64

    # Action expert: as many layers as the prefix has, each attending to that layer's keys and values.
    expert_width: int = 256
    expert_mlp_ratio: float = 4.0
    time_conditioning: str = "mlp"  # pi0; `adaptive_norm`: scales, shifts and gates of the norms follow time (pi0.5)
    time_min_period: float = 4e-3  # of the sines and cosines of time, as in pi0
    time_max_period: float = 4.0

    # Flow matching.
    time_alpha: float = 1.5  # training times are drawn from Beta(time_alpha, 1): more of them near the noise
    time_smallest: float = 1e-3  # then brought into [time_smallest, 1]
    num_inference_steps: int = 10  # Euler steps from noise to actions

    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: {
            "VISUAL": NormalizationMode.IDENTITY,
            "STATE": NormalizationMode.MEAN_STD,
            "ACTION": NormalizationMode.MEAN_STD,
        }
    )

    optimizer_lr: float = 3e-4
    scheduler_decay_steps: int | None = None  # cosine to `scheduler_decay_lr` in so many; null: to 0 over the run
    scheduler_decay_lr: float = 2.5e-6

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.prefix == "scratch" and self.image_size is None:
            self.image_size = SCRATCH_IMAGE_SIZE
        for kind, name, known in (
            ("prefix", self.prefix, PREFIXES),
            ("time_conditioning", self.time_conditioning, TIME_CONDITIONINGS),
            ("frozen_dtype", self.frozen_dtype, FROZEN_DTYPES),
        ):
            if name not in known:
                raise UnknownNameError(kind, name, known)
        self._check_sizes()

    def _check_sizes(self) -> None:
        self.check_at_least_one(("chunk_size", "n_action_steps", "prefix_depth", "num_inference_steps", "noise_draws"))
        if self.n_obs_steps != 1:
            raise UserError(f"n_obs_steps is {self.n_obs_steps}, but flow_vla sees one observation; set it to 1.")
        if self.n_action_steps > self.chunk_size:
            raise UserError(
                f"n_action_steps is {self.n_action_steps}, but only {self.chunk_size} actions are predicted; "
                "lower it or raise chunk_size."
            )
        if self.expert_width % 2 or self.expert_width < 2:
            raise UserError(f"expert_width is {self.expert_width}, expected an even number of at least 2.")
        self.check_crop()
        if not (self.time_alpha > 0.0 and 0.0 <= self.time_smallest < 1.0):
            raise UserError(
                f"time_alpha is {self.time_alpha} and time_smallest {self.time_smallest}, expected more than 0 for "
                "the first and 0 to below 1 for the second."
            )
        if not 0.0 < self.time_min_period < self.time_max_period:
            raise UserError(
                f"time_min_period is {self.time_min_period} and time_max_period {self.time_max_period}, expected "
                "0 < time_min_period < time_max_period."
            )
        if self.frozen_dtype != "float32" and not (self.freeze_vision or self.freeze_language):
            raise UserError(
                f"frozen_dtype is {self.frozen_dtype!r}, but nothing is frozen; set freeze_vision or "
                "freeze_language, or leave frozen_dtype at 'float32'."
            )
        if self.prefix == "scratch":
            self._check_scratch()

    def _check_scratch(self) -> None:
        if self.prefix_heads < 1 or self.prefix_kv_heads < 1 or self.prefix_heads % self.prefix_kv_heads:
            raise UserError(
                f"prefix_heads is {self.prefix_heads}, expected a multiple of prefix_kv_heads ({self.prefix_kv_heads})."
            )
        if self.prefix_width < 1 or self.prefix_width % self.prefix_heads:
            raise UserError(
                f"prefix_width is {self.prefix_width}, expected a multiple of prefix_heads ({self.prefix_heads})."
            )
        if self.prefix_head_dim < 2 or self.prefix_head_dim % 2:
            raise UserError(f"prefix_head_dim is {self.prefix_head_dim}, expected an even number.")
        self.check_channels()

    @property
    def observation_delta_indices(self) -> None:
        """Only the newest observation is used."""
        return None

    @property
    def action_delta_indices(self) -> list[int]:
        """Frame offsets of the predicted actions of a sample."""
        return list(range(self.chunk_size))

    def get_scheduler_preset(self) -> LRSchedulerConfig:
        """Linear warm-up and a cosine, over the run or over `scheduler_decay_steps`."""
        if self.scheduler_decay_steps is None:
            return DiffuserSchedulerConfig(name="cosine", num_warmup_steps=self.scheduler_warmup_steps)
        return CosineDecayWithWarmupSchedulerConfig(
            num_warmup_steps=self.scheduler_warmup_steps,
            num_decay_steps=self.scheduler_decay_steps,
            peak_lr=self.optimizer_lr,
            decay_lr=self.scheduler_decay_lr,
        )
