"""A line of text over a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

_HEIGHT = 26


def titled(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """A picture (H, W, 3) with a white line above it, in which a text stands."""
    title = Image.new("RGB", (picture.shape[1], _HEIGHT), "white")
    ImageDraw.Draw(title).text((8, 5), text, fill="black", font_size=14)
    return np.vstack([np.asarray(title), picture])
