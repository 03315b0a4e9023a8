"""The robot's state as a network takes it in."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from robocasa_lerobot.policies.common.configuration import ActionChunkConfig


class StateInput(nn.Module):
    """The state's components that the policy uses, bounded; no parameters, nothing in checkpoints."""

    def __init__(self, config: ActionChunkConfig) -> None:
        super().__init__()
        feature = config.robot_state_feature
        assert feature is not None  # checked by validate_features
        indices = range(feature.shape[0]) if config.state_indices is None else config.state_indices
        self.size, self._clip = len(indices), config.state_clip
        self.register_buffer("indices", torch.tensor(list(indices)), persistent=False)

    def forward(self, state: Tensor) -> Tensor:
        """Maps the normalised state (..., S) to (..., size)."""
        chosen = state.index_select(-1, self.indices)
        return chosen if self._clip is None else chosen.clamp(-self._clip, self._clip)
