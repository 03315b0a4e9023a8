"""Pictures at the size that a policy takes, as torchvision's Resize makes them."""

from __future__ import annotations

import torch

AT_ONCE = 16  # pictures: fewer make threads wait for each other, and more floats than a core's cache holds are slow


def resize_images(images: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    """Uint8 images (..., 3, H, W) at (height, width) `size`, bilinear with antialiasing as torchvision's Resize.

    Some at a time: each is the same alone, and a whole batch of floats at full size goes through memory several times.
    So 64 pictures of 256x256 take half the time or less. The order of the bytes of `images` is any.
    """
    if tuple(images.shape[-2:]) == tuple(size):
        return images
    flat = images.reshape(-1, *images.shape[-3:])
    out = torch.cat([_resized(some, size) for some in flat.split(AT_ONCE)])
    return out.reshape(*images.shape[:-2], *size)


def _resized(images: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    out = torch.nn.functional.interpolate(
        images.float(), size=size, mode="bilinear", antialias=True, align_corners=False
    )
    return out.round().clamp(0, 255).to(torch.uint8).contiguous()
