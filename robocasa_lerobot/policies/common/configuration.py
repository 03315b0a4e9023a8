"""What the configurations of our policies have in common, whatever their networks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import PreTrainedConfig
from lerobot.optim import AdamWConfig
from lerobot.optim.optimizers import OptimizerConfig

from robocasa_lerobot.contract import STATE_PARTS, STATE_SIZE, STATE_SLICES
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.policies.common.muon import MuonConfig
from robocasa_lerobot.policies.common.statistics import CONSTANT_RANGE

OPTIMIZERS = ("adamw", "muon")
LANGUAGE_HEADS = 4  # of the layer that makes a vector of an instruction's words


def state_without_base() -> list[int]:
    """Indices of the state's components that do not depend on where the kitchen's origin is."""
    slices = [STATE_SLICES[part.name] for part in STATE_PARTS if not part.name.startswith("base_")]
    return [i for s in slices for i in range(s.start, s.stop)]


@dataclass
class ActionChunkConfig(PreTrainedConfig):
    """Fields of a policy that predicts chunks of actions from cameras, state and an instruction.

    Image sizes are (height, width) in pixels. Fields of which policies want another default are stated again there.
    """

    n_action_steps: int = 8  # of the predicted actions, those that are executed

    # State: which components enter the network. The default leaves the base pose out; null takes all of them.
    state_indices: list[int] | None = field(default_factory=state_without_base)
    state_clip: float | None = None  # bound on normalised components, so that one outlier cannot saturate the network

    # Images: brought to `image_size`, then cropped to `crop_fraction` of each side, at random while training and in
    # the centre otherwise.
    image_size: tuple[int, int] | None = None
    crop_fraction: float = 1.0
    vision_channels: list[int] = field(default_factory=lambda: [32, 64, 128])  # of small encoders, one stride 2 each

    # Hashed words, where they are how instructions are read.
    language_buckets: int = 8192
    max_words: int = 64  # holds every instruction of the 365 tasks

    # Loss.
    mask_padded_actions: bool = True  # actions outside the episode do not count
    noise_draws: int = 1  # (time, noise) pairs per sample and step; pictures are read once for all of them

    # Normalisation. See `policies/common/statistics.py` for constant components.
    constant_range: float = CONSTANT_RANGE  # a narrower component (max - min) counts as constant and keeps its scale

    # Optimiser and warm-up, used by training unless it says otherwise. `muon` is for the matrices inside the network
    # and AdamW then for the rest (policies/common/muon.py).
    optimizer_name: str = "adamw"
    optimizer_matrix_lr: float = 0.01  # of `muon`
    optimizer_lr: float = 1e-4
    optimizer_betas: tuple[float, float] = (0.9, 0.95)
    optimizer_eps: float = 1e-8
    optimizer_weight_decay: float = 1e-3  # on the matrices of linear layers and attention
    optimizer_grad_clip_norm: float = 1.0  # 0: no clipping
    scheduler_warmup_steps: int = 1000

    push_to_hub: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.image_size is not None and min(self.image_size) < 1:
            raise UserError(
                f"image_size is {list(self.image_size)}, expected a height and a width of at least 1 pixel."
            )
        if self.state_clip is not None and not self.state_clip > 0:
            raise UserError(f"state_clip is {self.state_clip}, expected more than 0, or null for no bound.")
        if self.scheduler_warmup_steps < 0:
            raise UserError(f"scheduler_warmup_steps is {self.scheduler_warmup_steps}, expected 0 or more.")

    @property
    def reward_delta_indices(self) -> None:
        """No rewards are used."""
        return None

    def get_optimizer_preset(self) -> OptimizerConfig:
        """AdamW or Muon; AdamW's groups with their own weight decay come from the policy's `get_optim_params`.

        Raises:
            UnknownNameError: `optimizer_name` is another one.
        """
        shared: dict[str, Any] = {
            "lr": self.optimizer_lr,
            "betas": self.optimizer_betas,
            "eps": self.optimizer_eps,
            "weight_decay": self.optimizer_weight_decay,
            "grad_clip_norm": self.optimizer_grad_clip_norm,
        }
        if self.optimizer_name == "muon":
            return MuonConfig(**shared, matrix_lr=self.optimizer_matrix_lr)
        if self.optimizer_name != "adamw":
            raise UnknownNameError("optimizer_name", self.optimizer_name, OPTIMIZERS)
        return AdamWConfig(**shared)

    def check_at_least_one(self, names: Sequence[str]) -> None:
        """Check counts.

        Raises:
            UserError: one of the fields is below 1.
        """
        for name in names:
            if getattr(self, name) < 1:
                raise UserError(f"{name} is {getattr(self, name)}, expected at least 1.")

    def check_crop(self) -> None:
        """Check `crop_fraction`.

        Raises:
            UserError: nothing or more than everything is left.
        """
        if not 0.0 < self.crop_fraction <= 1.0:
            raise UserError(f"crop_fraction is {self.crop_fraction}, expected more than 0 and at most 1.")

    def check_channels(self) -> None:
        """Check `vision_channels`.

        Raises:
            UserError: there are none, or they cannot be normalised in groups of 8.
        """
        if not self.vision_channels or any(c % 8 for c in self.vision_channels):
            raise UserError(
                f"vision_channels is {self.vision_channels}, expected multiples of 8 (normalised in groups)."
            )

    def validate_features(self) -> None:
        """Check the features of the data against the fields; called when the policy is built.

        Raises:
            UserError: no state, no action, no camera, or state components that the data does not have.
        """
        if self.robot_state_feature is None or self.action_feature is None:
            found = ", ".join([*(self.input_features or {}), *(self.output_features or {})]) or "none"
            raise UserError(f"features {found}: {self.type} needs 'observation.state' and 'action'.")
        if not self.image_features:
            raise UserError(f"no camera among the input features: {self.type} needs at least one.")
        size = self.robot_state_feature.shape[0]
        if self.state_indices is None:
            return
        out_of_range = not self.state_indices or any(not 0 <= i < size for i in self.state_indices)
        # Of another robot's state the default would leave out whatever has these places there.
        if out_of_range or (size != STATE_SIZE and self.state_indices == state_without_base()):
            hint = "" if size == STATE_SIZE else f" The default is for the {STATE_SIZE} components of PandaOmron."
            raise UserError(
                f"state_indices is {self.state_indices}, but observation.state has {size} components.{hint} "
                "Set state_indices to null to use all of them."
            )
