"""Pictures as a server wants them: resized with or without their aspect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture = NDArray[np.uint8]


def resized(picture: Picture, size: tuple[int, int], rule: str) -> Picture:
    """A picture (H, W, 3) at `size` (height, width).

    `pad` scales until one side fits, rounding the other down, and centres the result on black, as openpi's clients do
    (`resize_with_pad` of openpi-client 0.1.2); `stretch` scales each side by itself. Both use Pillow's bilinear filter.
    """
    height, width = size
    if picture.shape[:2] == (height, width):
        return picture
    if rule == "stretch":
        return _scaled(picture, height, width)
    ratio = max(picture.shape[0] / height, picture.shape[1] / width)
    inside = _scaled(picture, int(picture.shape[0] / ratio), int(picture.shape[1] / ratio))
    if inside.shape[:2] == (height, width):
        return inside
    out = np.zeros((height, width, 3), np.uint8)
    top, left = (height - inside.shape[0]) // 2, (width - inside.shape[1]) // 2
    out[top : top + inside.shape[0], left : left + inside.shape[1]] = inside
    return out


def _scaled(picture: Picture, height: int, width: int) -> Picture:
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BILINEAR))
