"""Random changes of the pictures of a batch, computed where the batch is and drawn for each sample on its own."""

from __future__ import annotations

import fnmatch
import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from robocasa_lerobot.contract import ACTION_KEY
from robocasa_lerobot.data.mixture import MixtureMeta
from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.training.config.phase import AugmentConfig, PhaseConfig
from robocasa_lerobot.training.mirror import check_mirror, mirror

BLANK = 0.5  # mid-grey, what is zero to networks that take pictures in [-1, 1]
_GREY = (0.299, 0.587, 0.114)  # luma of ITU-R BT.601
# YIQ of the NTSC standard: the hue is the angle in the plane of its last two coordinates.
_TO_YIQ = torch.tensor([_GREY, (0.5959, -0.2746, -0.3213), (0.2115, -0.5227, 0.3112)])


def augment(
    batch: dict[str, Any], cameras: list[str], config: AugmentConfig, seed: int, rank: int = 0, processes: int = 1
) -> dict[str, Any]:
    """The batch with changed pictures, float (B, ..., 3, H, W) in [0, 1].

    The augmentation of a sample depends on the seed and its place in the batch of all processes only.
    """
    out = dict(batch)
    if config.mirror:
        chosen = _drawn(config.mirror, len(batch[ACTION_KEY]), (seed, len(cameras)), rank, processes)
        out = mirror(out, cameras, chosen)
    for number, key in enumerate(cameras):
        images = out[key]
        count = images.shape[0]
        generator = np.random.default_rng((seed, number))
        drawn = generator.uniform(-1, 1, (count * processes, 7))[rank * count : (rank + 1) * count]
        flat = images.reshape(count, -1, *images.shape[-3:])
        if (config.crop < 1 or config.rotate > 0) and _meant(key, config.crop_cameras):
            flat = _crop_and_rotate(flat, config, drawn[:, :3])
        flat = _jitter(flat, config, drawn[:, 3:])
        if config.blank and _meant(key, config.blank_cameras):
            blank = _drawn(config.blank, count, (seed, number, 1), rank, processes)
            flat = torch.where(blank.to(flat.device)[:, None, None, None, None], flat.new_tensor(BLANK), flat)
        out[key] = flat.reshape(images.shape)
    return out


def check_cameras(phase: PhaseConfig, meta: MixtureMeta) -> None:
    """Check that `augment.crop_cameras` and `blank_cameras` name some of the data's cameras, and `mirror` fits them.

    Raises:
        UnknownNameError: no pattern of one of them fits any camera, so that nothing would be changed.
        UserError: a mirror is asked for, for data of which it is not known what that makes of them.
    """
    config = phase.augment
    if config is None:
        return
    if config.mirror:
        check_mirror(meta)
    for field, patterns in (("crop_cameras", config.crop_cameras), ("blank_cameras", config.blank_cameras)):
        if patterns and not any(fnmatch.filter(meta.camera_keys, pattern) for pattern in patterns):
            raise UnknownNameError("camera", patterns[0], meta.camera_keys, f"(in `augment.{field}`)")


def _drawn(share: float, count: int, seed: tuple[int, ...], rank: int, processes: int) -> Tensor:
    """Which of the `count` samples of a process something happens to, (count,)."""
    chances = np.random.default_rng(seed).uniform(size=count * processes)
    return torch.from_numpy(chances[rank * count : (rank + 1) * count] < share)


def _meant(key: str, patterns: list[str] | None) -> bool:
    return patterns is None or any(fnmatch.fnmatchcase(key, pattern) for pattern in patterns)


def _crop_and_rotate(images: Tensor, config: AugmentConfig, drawn: NDArray[np.float64]) -> Tensor:
    """Pictures (B, T, 3, H, W), each looked up on a smaller, shifted and turned grid; the edge is repeated."""
    count, steps, channels, height, width = images.shape
    angle = np.deg2rad(config.rotate) * drawn[:, 0]
    cos, sin = config.crop * np.cos(angle), config.crop * np.sin(angle)
    shift = (1 - config.crop) * drawn[:, 1:]
    aspect = height / width
    theta = np.stack([cos, -sin * aspect, shift[:, 0], sin / aspect, cos, shift[:, 1]], axis=1).reshape(-1, 2, 3)
    grid = torch.nn.functional.affine_grid(
        torch.from_numpy(theta).to(images), [count, channels, height, width], align_corners=False
    )
    stacked = images.reshape(count, steps * channels, height, width)  # all time steps alike
    moved = torch.nn.functional.grid_sample(stacked, grid, padding_mode="border", align_corners=False)
    return moved.reshape(images.shape)


def _jitter(images: Tensor, config: AugmentConfig, drawn: NDArray[np.float64]) -> Tensor:
    """Brightness, contrast, saturation and hue of pictures (B, T, 3, H, W), in this order."""
    if not (config.brightness or config.contrast or config.saturation or config.hue):
        return images
    factors = torch.from_numpy(drawn).to(images)[:, :, None, None, None, None]
    grey = torch.tensor(_GREY).to(images).reshape(3, 1, 1)
    if config.brightness:
        images = (images * (1 + config.brightness * factors[:, 0]).clamp(min=0)).clamp(0, 1)
    if config.contrast:
        mean = (images * grey).sum(dim=-3, keepdim=True).mean(dim=(1, -2, -1), keepdim=True)
        images = (mean + (images - mean) * (1 + config.contrast * factors[:, 1]).clamp(min=0)).clamp(0, 1)
    if config.saturation:
        own = (images * grey).sum(dim=-3, keepdim=True)
        images = (own + (images - own) * (1 + config.saturation * factors[:, 2]).clamp(min=0)).clamp(0, 1)
    if config.hue:
        images = torch.einsum("bij,btjhw->btihw", _hue_turn(config.hue * drawn[:, 3]).to(images), images).clamp(0, 1)
    return images


def _hue_turn(turns: NDArray[np.float64]) -> Tensor:
    """Matrices (B, 3, 3) that turn the hue of RGB by so many full turns, and leave luma and greys as they are."""
    angle = torch.from_numpy(2 * math.pi * turns).float()
    turn = torch.zeros(len(turns), 3, 3)
    turn[:, 0, 0] = 1
    turn[:, 1, 1] = turn[:, 2, 2] = angle.cos()
    turn[:, 1, 2], turn[:, 2, 1] = -angle.sin(), angle.sin()
    return torch.linalg.inv(_TO_YIQ) @ turn @ _TO_YIQ
