"""One feature vector per observed step, from cameras, proprioception and the instruction."""

from __future__ import annotations

import torch
from lerobot.utils.constants import OBS_LANGUAGE_ATTENTION_MASK, OBS_LANGUAGE_TOKENS, OBS_STATE
from torch import Tensor, nn

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.images import center_crop, random_crop, resize, to_signed_float
from robocasa_lerobot.policies.common.language import ClipTextEncoder, TokenEncoder
from robocasa_lerobot.policies.common.state import StateInput
from robocasa_lerobot.policies.common.traced import Traced
from robocasa_lerobot.policies.common.vision import ConvNet, ResNet18, VisionEncoder
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)


class ObservationEncoder(nn.Module):
    """Features of shape (B, T, feature_dim), T = n_obs_steps, in the order cameras, state, (instruction)."""

    def __init__(self, config: DiffusionTransformerConfig) -> None:
        super().__init__()
        self.config = config
        self.image_keys = list(config.image_features)
        self.text_encoder = _text_encoder(config)
        dim = self.text_encoder.dim
        condition_dim = dim if config.language_film else None
        names = ["shared"] if config.vision_shared else self.image_keys
        self.vision = nn.ModuleDict({_module_name(name): _vision_encoder(config, condition_dim) for name in names})
        self._encoders = {name: Traced(encoder) for name, encoder in self.vision.items()}
        self.camera_embedding = (
            nn.Parameter(torch.randn(len(self.image_keys), dim) * 0.02)
            if config.vision_shared and config.language_film
            else None
        )
        self.state = StateInput(config)
        self.feature_dim = len(self.image_keys) * config.vision_features + self.state.size
        if config.language_concat:
            self.feature_dim += dim

    def forward(self, batch: dict[str, Tensor], generator: torch.Generator | None = None) -> Tensor:
        """Encode observations.

        Args:
            batch: cameras (B, T, 3, H, W) as uint8 or float in [0, 1]; `observation.state` (B, T, S), normalised;
                `observation.language.tokens` and `.attention_mask`, one instruction per sample.
            generator: for the random crops while training; None uses the global one.

        Returns:
            Features (B, T, feature_dim).
        """
        if OBS_LANGUAGE_TOKENS not in batch:
            raise UserError(
                f"the batch has no {OBS_LANGUAGE_TOKENS!r}: pass it through the policy's preprocessor, which makes "
                "tokens of the instruction."
            )
        language = self.text_encoder(batch[OBS_LANGUAGE_TOKENS], batch[OBS_LANGUAGE_ATTENTION_MASK])
        state = self.state(batch[OBS_STATE].to(language.dtype))
        steps = state.shape[1]
        parts = [self._see(batch, language, steps, generator), state]
        if self.config.language_concat:
            parts.append(language.unsqueeze(1).expand(-1, steps, -1))
        return torch.cat(parts, dim=-1)

    def _see(self, batch: dict[str, Tensor], language: Tensor, steps: int, generator: torch.Generator | None) -> Tensor:
        """Features of all cameras, (B, T, cameras * vision_features)."""
        pictures = [self._prepare(batch[key], generator) for key in self.image_keys]
        conditions = [language] * len(pictures)
        if self.camera_embedding is not None:
            conditions = [language + embedding for embedding in self.camera_embedding]
        conditions = [c.repeat_interleave(steps, dim=0) for c in conditions]
        if self.config.vision_shared:
            encoder = self._encoders["shared"]
            features = encoder(torch.cat(pictures), torch.cat(conditions)).chunk(len(pictures))
        else:
            encoders = [self._encoders[_module_name(key)] for key in self.image_keys]
            features = [e(p, c) for e, p, c in zip(encoders, pictures, conditions, strict=True)]
        return torch.cat([f.unflatten(0, (-1, steps)) for f in features], dim=-1)

    def _prepare(self, images: Tensor, generator: torch.Generator | None) -> Tensor:
        """Pictures (B, T, 3, H, W) as float in [-1, 1], resized and cropped, (B * T, 3, h, w)."""
        batch_size, steps = images.shape[:2]
        x = resize(images.flatten(0, 1), self.config.image_size)
        if self.training and self.config.crop_shared_over_time:
            x = random_crop(x.unflatten(0, (batch_size, steps)), self.config.crop_fraction, generator).flatten(0, 1)
        elif self.training:
            x = random_crop(x, self.config.crop_fraction, generator)
        else:
            x = center_crop(x, self.config.crop_fraction)
        return to_signed_float(x)


def _module_name(key: str) -> str:
    return key.replace(".", "_")


def _text_encoder(config: DiffusionTransformerConfig) -> TokenEncoder | ClipTextEncoder:
    if config.text_encoder == "token":
        return TokenEncoder(config.language_buckets, config.max_words, config.language_dim)
    encoder = ClipTextEncoder(config.clip_path, config.clip_config, config.clip_saved)
    config.clip_config = encoder.config  # so that a checkpoint can be built without `clip_path`
    return encoder


def _vision_encoder(config: DiffusionTransformerConfig, condition_dim: int | None) -> VisionEncoder:
    backbone: ResNet18 | ConvNet
    if config.vision_encoder == "resnet18":
        backbone = ResNet18(condition_dim)
    else:
        backbone = ConvNet(config.vision_channels, condition_dim, config.vision_stem)
    return VisionEncoder(backbone, config.vision_keypoints, config.vision_features, config.vision_grid)
