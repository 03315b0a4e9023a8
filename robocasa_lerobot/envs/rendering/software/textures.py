"""Textures as their smaller and smaller copies, so that a pixel takes few texels, however far away it is.

A texel is one number of 64 bits, its three channels 16 bits apart: of eight texels each channel of a pixel is a mixture
in eight multiplications instead of twenty-four.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled, inlined

LANE_BITS = 16
_LANES = 0x0000_00FF_00FF_00FF  # a byte in each lane
_TWOS = 0x0000_0002_0002_0002
_HALVES = 0x0000_0080_0080_0080
_WHOLE = 256  # sum of the weights of four texels


@dataclass(frozen=True)
class Textures:
    """All textures of a model.

    Attributes:
        texels: of all copies of all textures, row after row, (n,).
        levels: of each texture's copies, the largest first, where its texels begin, its width and its height;
            (textures, most copies, 3).
        counts: of copies, (textures,).
    """

    texels: NDArray[np.uint64]
    levels: NDArray[np.int32]
    counts: NDArray[np.int32]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Textures:
        """Of a model whose textures are all flat."""
        sizes = [_sizes(int(w), int(h)) for w, h in zip(model.tex_width, model.tex_height, strict=True)]
        counts = np.array([len(levels) for levels in sizes], dtype=np.int32)
        levels = np.zeros((len(sizes), max(counts, default=1), 3), dtype=np.int32)
        end = 0
        for number, copies in enumerate(sizes):
            for level, (width, height) in enumerate(copies):
                levels[number, level] = end, width, height
                end += width * height
        texels = np.zeros(max(end, 1), dtype=np.uint64)
        for number in range(model.ntex):
            channels, start = int(model.tex_nchannel[number]), int(model.tex_adr[number])
            width, height = sizes[number][0]
            pixels = model.tex_data[start : start + width * height * channels].reshape(height, width, channels)
            _shrink(pixels, levels[number, : counts[number]], texels)
        return cls(texels, levels, counts)


def _sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Width and height of a texture and of its copies, each half as large, down to a single texel."""
    sizes = [(width, height)]
    while max(sizes[-1]) > 1:
        width, height = sizes[-1]
        sizes.append((max(1, width // 2), max(1, height // 2)))
    return sizes


@compiled
def _shrink(pixels: NDArray[np.uint8], levels: NDArray[np.int32], texels: NDArray[np.uint64]) -> None:
    """Fill in a texture's texels from its pixels (height, width, channels), and those of its copies."""
    height, width, channels = pixels.shape
    start = levels[0, 0]
    for y in range(height):
        for x in range(width):
            texel = np.uint64(0)
            for channel in range(3):
                value = np.uint64(pixels[y, x, min(channel, channels - 1)])
                texel |= value << np.uint64(LANE_BITS * channel)
            texels[start + y * width + x] = texel
    for level in range(1, len(levels)):
        source, wide, high = levels[level - 1]
        target, width, height = levels[level]
        for y in range(height):
            above, below = source + min(2 * y, high - 1) * wide, source + min(2 * y + 1, high - 1) * wide
            for x in range(width):
                one, other = min(2 * x, wide - 1), min(2 * x + 1, wide - 1)
                total = texels[above + one] + texels[above + other] + texels[below + one] + texels[below + other]
                texels[target + y * width + x] = ((total + np.uint64(_TWOS)) >> np.uint64(2)) & np.uint64(_LANES)


@inlined
def _half_log2(value: float) -> float:
    """Half the logarithm to base 2 of a number from 1 to 2, off by less than 0.005."""
    x = value - 1.0
    return x * (0.7117 + x * (-0.2911 + 0.0794 * x))


@inlined
def _mixed(texels: NDArray[np.uint64], start: int, width: int, height: int, u: float, v: float) -> np.uint64:
    """Colour of one copy at (u, v), each from 0 to 1: its four nearest texels by their nearness."""
    x, y = int(u * (width << 8)) - 128, int(v * (height << 8)) - 128
    x0, y0 = x >> 8, y >> 8
    right, down = np.uint64(x & 255), np.uint64(y & 255)
    # Chosen, not branched to: half of all branches would be foretold wrongly.
    x0 = x0 + width if x0 < 0 else x0
    x1 = x0 + 1 if x0 + 1 < width else 0
    y0 = y0 + height if y0 < 0 else y0
    y1 = y0 + 1 if y0 + 1 < height else 0
    both = (right * down + np.uint64(128)) >> np.uint64(8)
    upper, lower = start + y0 * width, start + y1 * width
    # Numbers without a sign, which need no look at whether they count from the end.
    return (
        texels[np.uint64(upper + x0)] * (np.uint64(_WHOLE) + both - right - down)
        + texels[np.uint64(upper + x1)] * (right - both)
        + texels[np.uint64(lower + x0)] * (down - both)
        + texels[np.uint64(lower + x1)] * both
    )


@inlined
def sampled(
    texels: NDArray[np.uint64], levels: NDArray[np.int32], count: int, u: float, v: float, spread: float
) -> np.uint64:
    """Colour of a texture at (u, v), three channels of 8 bits whole and 8 bits fraction, `LANE_BITS` apart.

    Mixed from the four nearest texels of the two copies whose texels are about as large as a pixel.

    Args:
        texels: as in `Textures`.
        levels: of this texture, as in `Textures`.
        count: of its copies.
        u: where, 1 for the texture's whole width; it is repeated.
        v: where, 1 for its whole height.
        spread: square of the texels of the first copy that a pixel is wide.
    """
    u -= np.floor(u)
    v -= np.floor(v)
    if spread <= 1.0 or count == 1:
        return _mixed(texels, levels[0, 0], levels[0, 1], levels[0, 2], u, v)
    # Half the logarithm to base 2, in 1/256: from the number's exponent, and its mantissa as a polynomial.
    exponent = 0
    while spread >= 4.0:
        spread *= 0.25
        exponent += 1
    if spread >= 2.0:
        part = 0.5 + _half_log2(0.5 * spread)
    else:
        part = _half_log2(spread)
    if exponent >= count - 1:
        return _mixed(texels, levels[count - 1, 0], levels[count - 1, 1], levels[count - 1, 2], u, v)
    far = np.uint64(part * _WHOLE)
    one = _mixed(texels, levels[exponent, 0], levels[exponent, 1], levels[exponent, 2], u, v)
    if far == 0:
        return one
    exponent += 1
    other = _mixed(texels, levels[exponent, 0], levels[exponent, 1], levels[exponent, 2], u, v)
    one = ((one + np.uint64(_HALVES)) >> np.uint64(8)) & np.uint64(_LANES)
    other = ((other + np.uint64(_HALVES)) >> np.uint64(8)) & np.uint64(_LANES)
    return one * (np.uint64(_WHOLE) - far) + other * far
