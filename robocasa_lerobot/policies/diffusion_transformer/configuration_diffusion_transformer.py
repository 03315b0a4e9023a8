"""Configuration of the policy type `diffusion_transformer`.

The structure is the Diffusion Policy transformer of the RoboCasa365 benchmark. Where the published training
differs from what is right, the choice is a named field: the defaults are what is right, and
`configs/policies/diffusion_transformer_benchmark.yaml` has every one of them as published.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.optim import DiffuserSchedulerConfig

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.policies.common.configuration import LANGUAGE_HEADS, ActionChunkConfig

VISION_ENCODERS = ("resnet18", "convnet")
TEXT_ENCODERS = ("token", "clip")
NOISE_SCHEDULERS = ("DDPM", "DDIM")
TIMESTEP_SPACINGS = ("trailing", "leading", "linspace")
PREDICTION_TYPES = ("epsilon", "sample")
BETA_SCHEDULES = ("linear", "scaled_linear", "squaredcos_cap_v2")


@PreTrainedConfig.register_subclass("diffusion_transformer")
@dataclass
class DiffusionTransformerConfig(ActionChunkConfig):
    """Fields of the policy beside the common ones; lengths in control steps."""

    # Time. Predicted actions lie at offsets 1 - n_obs_steps ... horizon - n_obs_steps from the newest observation;
    # the `n_action_steps` from offset 0 on are executed. Observations are the last n_obs_steps, or those at the given
    # offsets, ascending up to 0, such as [-6, -4, -2, 0]: n_obs_steps is then their number. Before an episode's start
    # its first observation counts, in training and in evaluation.
    n_obs_steps: int = 2
    observation_offsets: list[int] | None = None
    horizon: int = 10
    n_action_steps: int = 8
    drop_n_last_frames: int | None = None  # None: horizon - n_action_steps - n_obs_steps + 1, as LeRobot's diffusion

    state_clip: float | None = 3.0

    # Images: `image_size` null leaves them as they come.
    crop_fraction: float = 0.875  # 224 of 256 pixels
    crop_shared_over_time: bool = True  # the frames of one sample and camera get the same random crop
    vision_encoder: str = "resnet18"
    vision_shared: bool = False  # one encoder for all cameras (told apart by an embedding) instead of one each
    vision_stem: int = 2  # stride of a convnet's first convolution; the others have 2
    vision_keypoints: int = 32
    vision_grid: int | None = None  # instead of keypoints, features of each cell of a grid of so many rows and columns
    vision_features: int = 64  # per camera

    # Language. `token`: hashed words and character trigrams, trained with the policy, no download.
    # `clip`: a frozen CLIP text encoder from `clip_path` (hub name or folder).
    text_encoder: str = "token"
    clip_path: str = "openai/clip-vit-large-patch14"
    clip_saved: bool = True  # weights go into the checkpoint; false: only `clip_path` is recorded
    clip_config: dict[str, Any] | None = None  # filled in from `clip_path` when the policy is first built
    language_dim: int = 128  # of `token`; `clip` has its own
    language_film: bool = True  # modulates every block of the vision encoder
    language_concat: bool = False  # also concatenated to the features of each observation

    # Looking ahead: while training, features of the observation must also tell, by themselves, how far the next
    # `look_ahead` steps travel (look_ahead.py). 0: they need not.
    look_ahead: int = 0
    look_ahead_weight: float = 1.0  # beside the loss of actions

    # Denoising transformer.
    width: int = 512
    n_heads: int = 8
    n_decoder_layers: int = 12
    n_condition_layers: int = 4  # 0: a small multi-layer perceptron instead
    dropout_embedding: float = 0.0
    dropout: float = 0.3

    # Diffusion.
    noise_scheduler: str = "DDIM"
    num_train_timesteps: int = 100
    time_alpha: float = 1.0  # training times are drawn from Beta(time_alpha, 1): above 1 more of them near the noise
    num_inference_steps: int | None = 10  # null: as many as for training
    beta_schedule: str = "squaredcos_cap_v2"
    beta_start: float = 1e-4
    beta_end: float = 0.02
    prediction_type: str = "epsilon"
    timestep_spacing: str = "trailing"  # sampling starts at the noisiest step; `leading` (published) starts below it
    clip_sample: bool = True
    clip_sample_range: float = 1.0

    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: {
            "VISUAL": NormalizationMode.IDENTITY,
            "STATE": NormalizationMode.MIN_MAX,
            "ACTION": NormalizationMode.MIN_MAX,
        }
    )
    quaternions_as_they_are: bool = False  # true: state quaternions are not normalised (published)

    # `optimizer_weight_decay` is for the matrices of the transformer.
    optimizer_encoder_weight_decay: float = 1e-6  # on everything before it
    scheduler_name: str = "cosine"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.observation_offsets is not None:
            self.n_obs_steps = self._number_of_offsets(self.observation_offsets)
        self._drops_by_lengths = self.drop_n_last_frames is None
        if self.drop_n_last_frames is None:
            self.drop_n_last_frames = max(0, self.horizon - self.n_action_steps - self.n_obs_steps + 1)
        self._check_names()
        self._check_sizes()

    def _save_pretrained(self, save_directory: Path) -> None:
        """Write config.json; what follows from the lengths stays open in it, since a later phase may change them."""
        saved = copy.copy(self)
        if self._drops_by_lengths:
            saved.drop_n_last_frames = None
        super(DiffusionTransformerConfig, saved)._save_pretrained(save_directory)

    def _number_of_offsets(self, offsets: list[int]) -> int:
        default = type(self).__dataclass_fields__["n_obs_steps"].default
        if not offsets or offsets[-1] != 0 or sorted(set(offsets)) != offsets:
            raise UserError(
                f"observation_offsets: found {offsets}, expected ascending control steps up to 0, such as "
                "[-6, -4, -2, 0]."
            )
        if self.n_obs_steps not in (default, len(offsets)):
            raise UserError(
                f"n_obs_steps is {self.n_obs_steps}, but observation_offsets has {len(offsets)} steps: set both alike."
            )
        return len(offsets)

    def _check_names(self) -> None:
        for kind, name, known in (
            ("vision_encoder", self.vision_encoder, VISION_ENCODERS),
            ("text_encoder", self.text_encoder, TEXT_ENCODERS),
            ("noise_scheduler", self.noise_scheduler, NOISE_SCHEDULERS),
            ("timestep_spacing", self.timestep_spacing, TIMESTEP_SPACINGS),
            ("prediction_type", self.prediction_type, PREDICTION_TYPES),
            ("beta_schedule", self.beta_schedule, BETA_SCHEDULES),
        ):
            if name not in known:
                raise UnknownNameError(kind, name, known)

    def _check_sizes(self) -> None:
        self.check_at_least_one(("n_obs_steps", "horizon", "n_action_steps", "noise_draws"))
        self.check_at_least_one(("width", "n_heads", "n_decoder_layers", "vision_keypoints", "vision_stem"))
        self.check_at_least_one(("vision_features", "num_train_timesteps"))
        assert self.drop_n_last_frames is not None
        if self.drop_n_last_frames < 0:
            raise UserError(f"drop_n_last_frames is {self.drop_n_last_frames}, expected 0 or more.")
        for name in ("dropout", "dropout_embedding"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise UserError(f"{name} is {getattr(self, name)}, expected at least 0 and below 1.")
        if not self.clip_sample_range > 0:
            raise UserError(f"clip_sample_range is {self.clip_sample_range}, expected more than 0.")
        if self.vision_grid is not None:
            self.check_at_least_one(("vision_grid",))
        longest = self.horizon - self.n_obs_steps + 1
        if self.n_action_steps > longest:
            raise UserError(
                f"n_action_steps is {self.n_action_steps}, but horizon {self.horizon} with n_obs_steps "
                f"{self.n_obs_steps} reaches only {longest} actions from now on; lower it or raise horizon."
            )
        if self.width % self.n_heads or self.width % 2:
            raise UserError(f"width is {self.width}, expected an even multiple of n_heads ({self.n_heads}).")
        if self.look_ahead < 0 or self.look_ahead_weight < 0 or self.time_alpha <= 0:
            raise UserError(
                f"look_ahead is {self.look_ahead}, look_ahead_weight {self.look_ahead_weight} and time_alpha "
                f"{self.time_alpha}: expected at least 0, at least 0, and more than 0."
            )
        self.check_at_least_one(("max_words", "language_buckets", "language_dim"))
        if self.n_condition_layers < 0:
            raise UserError(f"n_condition_layers is {self.n_condition_layers}, expected 0 or more.")
        if self.text_encoder == "token" and self.language_dim % LANGUAGE_HEADS:
            raise UserError(f"language_dim is {self.language_dim}, expected a multiple of {LANGUAGE_HEADS}.")
        self.check_crop()
        self.check_channels()
        if self.num_inference_steps is not None and not 1 <= self.num_inference_steps <= self.num_train_timesteps:
            raise UserError(
                f"num_inference_steps is {self.num_inference_steps}, expected 1 to num_train_timesteps "
                f"({self.num_train_timesteps})."
            )
        mode = self.normalization_mapping.get("ACTION", NormalizationMode.IDENTITY)
        if self.clip_sample and mode not in (NormalizationMode.MIN_MAX, NormalizationMode.IDENTITY):
            raise UserError(
                f"clip_sample is true and actions are normalised by {mode.value}: found actions beyond +-"
                f"{self.clip_sample_range} in any data, which sampling would cut off. Set `clip_sample: false`, or "
                "normalise ACTION by MIN_MAX."
            )
        if not (self.language_film or self.language_concat):
            raise UserError("language_film and language_concat are both false: the instruction would not be used.")

    @property
    def observation_delta_indices(self) -> list[int]:
        """Frame offsets of the observations of a sample."""
        return list(self.observation_offsets or range(1 - self.n_obs_steps, 1))

    @property
    def action_delta_indices(self) -> list[int]:
        """Frame offsets of the predicted actions of a sample, and of those that it looks ahead to."""
        first = 1 - self.n_obs_steps
        return list(range(first, max(first + self.horizon, self.look_ahead)))

    def get_scheduler_preset(self) -> DiffuserSchedulerConfig:
        """Linear warm-up, then (by default) half a cosine over the rest of the run."""
        return DiffuserSchedulerConfig(name=self.scheduler_name, num_warmup_steps=self.scheduler_warmup_steps)
