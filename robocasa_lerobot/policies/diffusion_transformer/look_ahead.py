"""Where it is going, told from the observation alone: a second loss while training.

A chunk of half a second is mostly told by how the hand moves already, and by the noisy chunk that a denoiser is shown.
How far the next seconds travel is told by where the goal is, and that only pictures show.
"""

from __future__ import annotations

from collections.abc import Mapping

from lerobot.utils.constants import ACTION
from torch import Tensor, nn
from torch.nn import functional

from robocasa_lerobot.contract import ACTION_SIZE, ACTION_SLICES
from robocasa_lerobot.policies.common.chunks import ACTION_IS_PAD, masked_mean

TRAVELLING = ("base_motion", "end_effector_position")  # parts of an action whose sum over time is a displacement


class LookAhead(nn.Module):
    """Two layers from the newest features to the mean of the next actions, times the root of their number.

    That is how far they travel; the root keeps the scale whatever the number of steps. Of the contract's actions the
    parts that move count, of other robots' all.
    """

    def __init__(self, feature_dim: int, width: int, action_dim: int, steps: int, first: int) -> None:
        """`first` is the offset of the batch's first action from the newest observation, not above 0."""
        super().__init__()
        self.steps, self.first = steps, first
        parts = [ACTION_SLICES[part] for part in TRAVELLING]
        contract = [i for s in parts for i in range(s.start, s.stop)]
        self.indices = contract if action_dim == ACTION_SIZE else list(range(action_dim))
        self.layers = nn.Sequential(nn.Linear(feature_dim, width), nn.GELU(), nn.Linear(width, len(self.indices)))

    def forward(self, features: Tensor, batch: Mapping[str, Tensor]) -> Tensor:
        """Squared error of each sample, (B,), for features (B, T, feature_dim) and actions (B, L, A).

        Where steps are padded, the others stand for them; a sample of padded ones alone counts as zero.
        """
        window = slice(-self.first, self.steps - self.first)
        moves = batch[ACTION].float()[:, window][..., self.indices]
        padded = batch[ACTION_IS_PAD][:, window] if ACTION_IS_PAD in batch else None
        travel = masked_mean(moves, padded) * self.steps**0.5
        told = self.layers(features[:, -1]).float()
        error = functional.mse_loss(told, travel, reduction="none").mean(dim=-1)
        return error if padded is None else error * ~padded.all(dim=1)
