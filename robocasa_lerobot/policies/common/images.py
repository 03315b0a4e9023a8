"""From camera images as a dataset or an env gives them to what a vision encoder takes."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from robocasa_lerobot.policies.common.transfer import is_plain_cpu, to_device


def to_signed_float(images: Tensor) -> Tensor:
    """Images as float in [-1, 1], from uint8 in [0, 255] or float in [0, 1]; any shape."""
    if images.dtype == torch.uint8:
        return images.to(torch.get_default_dtype()) / 127.5 - 1.0
    return images.to(torch.get_default_dtype()) * 2.0 - 1.0


def resize(images: Tensor, size: tuple[int, int] | None) -> Tensor:
    """Images of shape (N, C, H, W) at `size` (height, width), smoothed when shrunk; None leaves them.

    Values stay in their range, except that uint8 becomes float in [0, 1].
    """
    if size is None or tuple(images.shape[-2:]) == tuple(size):
        return images
    if images.dtype == torch.uint8:
        images = images.to(torch.get_default_dtype()) / 255.0
    return functional.interpolate(images, size=tuple(size), mode="bilinear", antialias=True, align_corners=False)


def crop_size(size: tuple[int, int], fraction: float) -> tuple[int, int]:
    """Height and width in pixels of a crop that keeps `fraction` of each side."""
    return max(1, round(size[0] * fraction)), max(1, round(size[1] * fraction))


def center_crop(images: Tensor, fraction: float) -> Tensor:
    """The middle of images of shape (..., H, W)."""
    height, width = images.shape[-2:]
    h, w = crop_size((height, width), fraction)
    top, left = (height - h) // 2, (width - w) // 2
    return images[..., top : top + h, left : left + w]


def random_crop(images: Tensor, fraction: float, generator: torch.Generator | None = None) -> Tensor:
    """A crop at a random place for each of images of shape (N, ..., H, W), the same for all that shares an index N.

    Places are drawn on the CPU, so that a seed gives the same crops on every device.
    """
    count, (height, width) = images.shape[0], images.shape[-2:]
    h, w = crop_size((height, width), fraction)
    if (h, w) == (height, width):
        return images
    tops = torch.randint(height - h + 1, (count,), generator=generator)
    lefts = torch.randint(width - w + 1, (count,), generator=generator)
    if is_plain_cpu(images.device):
        places = zip(images, tops.tolist(), lefts.tolist(), strict=True)
        return torch.stack([image[..., t : t + h, left : left + w] for image, t, left in places])
    return _windows(images, to_device(tops, images.device), to_device(lefts, images.device), (h, w))


def _windows(images: Tensor, tops: Tensor, lefts: Tensor, size: tuple[int, int]) -> Tensor:
    """Windows of images (N, ..., H, W), one of `size` each: one kernel, where slices would be one for each image."""
    flat = images.flatten(1, -3) if images.ndim > 3 else images.unsqueeze(1)
    count, channels = flat.shape[:2]
    image = torch.arange(count, device=images.device).view(-1, 1, 1, 1)
    channel = torch.arange(channels, device=images.device).view(1, -1, 1, 1)
    rows = (tops[:, None] + torch.arange(size[0], device=images.device)).view(count, 1, -1, 1)
    columns = (lefts[:, None] + torch.arange(size[1], device=images.device)).view(count, 1, 1, -1)
    return flat[image, channel, rows, columns].reshape(*images.shape[:-2], *size)
