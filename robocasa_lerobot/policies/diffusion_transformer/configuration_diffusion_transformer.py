"""Configuration of the policy type `diffusion_transformer`.

The structure is the Diffusion Policy transformer of the RoboCasa365 benchmark. Where the published training
differs from what is right, the choice is a named field: the defaults are what is right, and
`configs/policies/diffusion_transformer_benchmark.yaml` has every one of them as published.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.optim import AdamWConfig, DiffuserSchedulerConfig

from robocasa_lerobot.contract import STATE_PARTS, STATE_SIZE, STATE_SLICES
from robocasa_lerobot.errors import UnknownNameError, UserError

VISION_ENCODERS = ("resnet18", "convnet")
TEXT_ENCODERS = ("token", "clip")
NOISE_SCHEDULERS = ("DDPM", "DDIM")
TIMESTEP_SPACINGS = ("trailing", "leading", "linspace")
PREDICTION_TYPES = ("epsilon", "sample")


def _state_without_base() -> list[int]:
    """Indices of the state parts that do not depend on where the kitchen's origin is."""
    parts = [part.name for part in STATE_PARTS if not part.name.startswith("base_")]
    return [i for name in parts for i in range(STATE_SLICES[name].start, STATE_SLICES[name].stop)]


@PreTrainedConfig.register_subclass("diffusion_transformer")
@dataclass
class DiffusionTransformerConfig(PreTrainedConfig):
    """Fields of the policy; lengths in control steps, image sizes in pixels (height, width)."""

    # Time. Predicted actions lie at offsets 1 - n_obs_steps ... horizon - n_obs_steps from the newest observation;
    # the `n_action_steps` from offset 0 on are executed.
    n_obs_steps: int = 2
    horizon: int = 10
    n_action_steps: int = 8
    drop_n_last_frames: int | None = None  # None: horizon - n_action_steps - n_obs_steps + 1, as LeRobot's diffusion

    # State: which components enter the network. The default leaves the base pose out; null takes all of them.
    state_indices: list[int] | None = field(default_factory=_state_without_base)
    state_clip: float | None = 3.0  # bound on normalised components, so that one outlier cannot saturate the network

    # Images: resized to `image_size` first (null: as they come), then cropped to `crop_fraction` of each side,
    # at random while training and in the centre otherwise.
    image_size: tuple[int, int] | None = None
    crop_fraction: float = 0.875  # 224 of 256 pixels
    crop_shared_over_time: bool = True  # the frames of one sample and camera get the same random crop
    vision_encoder: str = "resnet18"
    vision_shared: bool = False  # one encoder for all cameras (told apart by an embedding) instead of one each
    vision_channels: list[int] = field(default_factory=lambda: [32, 64, 128])  # of `convnet`, one stride 2 each
    vision_keypoints: int = 32
    vision_features: int = 64  # per camera

    # Language. `token`: hashed words and character trigrams, trained with the policy, no download.
    # `clip`: a frozen CLIP text encoder from `clip_path` (hub name or folder).
    text_encoder: str = "token"
    clip_path: str = "openai/clip-vit-large-patch14"
    clip_saved: bool = True  # weights go into the checkpoint; false: only `clip_path` is recorded
    clip_config: dict[str, Any] | None = None  # filled in from `clip_path` when the policy is first built
    language_dim: int = 128  # of `token`; `clip` has its own
    language_buckets: int = 8192
    max_words: int = 32
    language_film: bool = True  # modulates every block of the vision encoder
    language_concat: bool = False  # also concatenated to the features of each observation

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
    num_inference_steps: int | None = 10  # null: as many as for training
    beta_schedule: str = "squaredcos_cap_v2"
    beta_start: float = 1e-4
    beta_end: float = 0.02
    prediction_type: str = "epsilon"
    timestep_spacing: str = "trailing"  # sampling starts at the noisiest step; `leading` (published) starts below it
    clip_sample: bool = True
    clip_sample_range: float = 1.0

    # Loss.
    mask_padded_actions: bool = True  # actions past either end of the episode do not count
    noise_draws: int = 1  # (timestep, noise) pairs per sample and step; encoding images once for all of them

    # Normalisation. See `policies/common/statistics.py` for constant components.
    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: {
            "VISUAL": NormalizationMode.IDENTITY,
            "STATE": NormalizationMode.MIN_MAX,
            "ACTION": NormalizationMode.MIN_MAX,
        }
    )
    quaternions_as_they_are: bool = False  # true: state quaternions are not normalised (published)
    constant_range: float = 1e-3  # a narrower component (max - min) counts as constant and keeps its scale

    # Optimiser and schedule, used by training unless it says otherwise.
    optimizer_lr: float = 1e-4
    optimizer_betas: tuple[float, float] = (0.9, 0.95)
    optimizer_eps: float = 1e-8
    optimizer_weight_decay: float = 1e-3  # on the matrices of the transformer
    optimizer_encoder_weight_decay: float = 1e-6  # on everything before it
    optimizer_grad_clip_norm: float = 1.0  # 0: no clipping
    scheduler_name: str = "cosine"
    scheduler_warmup_steps: int = 1000

    push_to_hub: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.drop_n_last_frames is None:
            self.drop_n_last_frames = max(0, self.horizon - self.n_action_steps - self.n_obs_steps + 1)
        self._check_names()
        self._check_sizes()

    def _check_names(self) -> None:
        for kind, name, known in (
            ("vision_encoder", self.vision_encoder, VISION_ENCODERS),
            ("text_encoder", self.text_encoder, TEXT_ENCODERS),
            ("noise_scheduler", self.noise_scheduler, NOISE_SCHEDULERS),
            ("timestep_spacing", self.timestep_spacing, TIMESTEP_SPACINGS),
            ("prediction_type", self.prediction_type, PREDICTION_TYPES),
        ):
            if name not in known:
                raise UnknownNameError(kind, name, known)

    def _check_sizes(self) -> None:
        for name in ("n_obs_steps", "horizon", "n_action_steps", "width", "n_heads", "n_decoder_layers", "noise_draws"):
            if getattr(self, name) < 1:
                raise UserError(f"{name} is {getattr(self, name)}, expected at least 1.")
        longest = self.horizon - self.n_obs_steps + 1
        if self.n_action_steps > longest:
            raise UserError(
                f"n_action_steps is {self.n_action_steps}, but horizon {self.horizon} with n_obs_steps "
                f"{self.n_obs_steps} reaches only {longest} actions from now on; lower it or raise horizon."
            )
        if self.width % self.n_heads or self.width % 2:
            raise UserError(f"width is {self.width}, expected an even multiple of n_heads ({self.n_heads}).")
        if not 0.0 < self.crop_fraction <= 1.0:
            raise UserError(f"crop_fraction is {self.crop_fraction}, expected more than 0 and at most 1.")
        if not self.vision_channels or any(c % 8 for c in self.vision_channels):
            raise UserError(
                f"vision_channels is {self.vision_channels}, expected multiples of 8 (normalised in groups)."
            )
        if self.num_inference_steps is not None and not 1 <= self.num_inference_steps <= self.num_train_timesteps:
            raise UserError(
                f"num_inference_steps is {self.num_inference_steps}, expected 1 to num_train_timesteps "
                f"({self.num_train_timesteps})."
            )
        if not (self.language_film or self.language_concat):
            raise UserError("language_film and language_concat are both false: the instruction would not be used.")

    @property
    def observation_delta_indices(self) -> list[int]:
        """Frame offsets of the observations of a sample."""
        return list(range(1 - self.n_obs_steps, 1))

    @property
    def action_delta_indices(self) -> list[int]:
        """Frame offsets of the predicted actions of a sample."""
        return list(range(1 - self.n_obs_steps, 1 - self.n_obs_steps + self.horizon))

    @property
    def reward_delta_indices(self) -> None:
        """No rewards are used."""
        return None

    def get_optimizer_preset(self) -> AdamWConfig:
        """AdamW; the groups with their own weight decay come from the policy's `get_optim_params`."""
        return AdamWConfig(
            lr=self.optimizer_lr,
            betas=self.optimizer_betas,
            eps=self.optimizer_eps,
            weight_decay=self.optimizer_weight_decay,
            grad_clip_norm=self.optimizer_grad_clip_norm,
        )

    def get_scheduler_preset(self) -> DiffuserSchedulerConfig:
        """Linear warm-up, then (by default) half a cosine over the rest of the run."""
        return DiffuserSchedulerConfig(name=self.scheduler_name, num_warmup_steps=self.scheduler_warmup_steps)

    def validate_features(self) -> None:
        """Check the features of the data against the fields; called when the policy is built.

        Raises:
            UserError: no state, no action, no camera, or state components that the data does not have.
        """
        if self.robot_state_feature is None or self.action_feature is None:
            found = ", ".join([*(self.input_features or {}), *(self.output_features or {})]) or "none"
            raise UserError(f"features {found}: diffusion_transformer needs 'observation.state' and 'action'.")
        if not self.image_features:
            raise UserError("no camera among the input features: diffusion_transformer needs at least one.")
        size = self.robot_state_feature.shape[0]
        if self.state_indices is None:
            return
        if not self.state_indices or any(not 0 <= i < size for i in self.state_indices):
            hint = "" if size == STATE_SIZE else " The default is for the 16 components of RoboCasa's PandaOmron."
            raise UserError(
                f"state_indices is {self.state_indices}, but observation.state has {size} components.{hint} "
                "Set state_indices to null to use all of them."
            )
