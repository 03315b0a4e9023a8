"""Textures generated from a record: wood, stone, tile, plaster, brushed metal. No image files are shipped.

A texture is a pure function of its record, so a recorded scene names its textures and anyone can make them again.
"""

from __future__ import annotations

import functools
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robocasa_lerobot.errors import UnknownNameError

TEXTURE_SIZE = 256  # pixels, height and width

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class TextureRecord:
    """What a generated texture is made from.

    Attributes:
        kind: a key of `GENERATORS`.
        rgb: main colour, components in [0, 1].
        rgb2: second colour (grain, veins, joints), components in [0, 1].
        seed: of the pattern.
        scale_m: edge length in metres that one repetition covers on a surface.
    """

    kind: str
    rgb: Rgb
    rgb2: Rgb
    seed: int = 0
    scale_m: float = 1.0

    @property
    def file(self) -> str:
        """File name that scenes give the texture; unique to the record."""
        colours = "".join(f"{round(c * 255):02x}" for c in (*self.rgb, *self.rgb2))
        return f"textures/{self.kind}_{colours}_{self.seed}.png"


def _fourier_noise(rng: np.random.Generator, exponent: float, stretch: tuple[float, float]) -> NDArray[np.float64]:
    """Tileable power-law noise in [0, 1], shape (size, size); `stretch` > 1 elongates it along an axis."""
    frequency = np.fft.fftfreq(TEXTURE_SIZE) * TEXTURE_SIZE
    radius = np.hypot(frequency[:, None] * stretch[0], frequency[None, :] * stretch[1])
    radius[0, 0] = 1.0
    spectrum = np.fft.fft2(rng.standard_normal((TEXTURE_SIZE, TEXTURE_SIZE))) / radius**exponent
    spectrum[0, 0] = 0.0
    noise = np.fft.ifft2(spectrum).real
    low, high = np.percentile(noise, [1, 99])
    return np.clip((noise - low) / (high - low), 0.0, 1.0)


def _mix(rgb: Rgb, rgb2: Rgb, amount: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(rgb) * (1.0 - amount[..., None]) + np.asarray(rgb2) * amount[..., None]


def _wood(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Grain along the vertical axis: warped stripes with fine fibres."""
    warp = _fourier_noise(rng, 2.2, (6.0, 1.0))
    column = np.linspace(0.0, 1.0, TEXTURE_SIZE, endpoint=False)[None, :]
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (5 * column + 2.2 * warp))
    fibres = _fourier_noise(rng, 0.9, (14.0, 1.0))
    return _mix(record.rgb, record.rgb2, 0.55 * rings**2 + 0.35 * fibres)


def _stone(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Marble-like: soft clouds with thin veins where a noise field crosses its middle."""
    clouds = _fourier_noise(rng, 1.8, (1.0, 1.0))
    field = _fourier_noise(rng, 2.0, (1.0, 1.6))
    veins = np.exp(-(((field - 0.5) / 0.02) ** 2))
    return _mix(record.rgb, record.rgb2, np.clip(0.22 * clouds + 0.65 * veins, 0, 1))


def _granite(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Speckles of two sizes."""
    coarse = _fourier_noise(rng, 0.8, (1.0, 1.0))
    fine = rng.random((TEXTURE_SIZE, TEXTURE_SIZE))
    return _mix(record.rgb, record.rgb2, np.clip(0.9 * (coarse > 0.62) * 0.6 + 0.35 * (fine > 0.8), 0, 1))


def _tile(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Four by four square tiles with joints, each tile a little lighter or darker."""
    count, joint = 4, 3
    step = TEXTURE_SIZE // count
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    in_joint = ((row % step) < joint) | ((column % step) < joint)
    shade = 1.0 + rng.uniform(-0.05, 0.05, (count, count))[row // step, column // step]
    clouds = 0.97 + 0.06 * _fourier_noise(rng, 1.6, (1.0, 1.0))
    tiles = np.asarray(record.rgb) * (shade * clouds)[..., None]
    return np.where(in_joint[..., None], np.asarray(record.rgb2), tiles)


def _subway(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Bricks of 2:1 in a running bond, as on a splashback."""
    rows, joint = 8, 3
    height, width = TEXTURE_SIZE // rows, TEXTURE_SIZE // 4
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    shifted = (column + (row // height % 2) * (width // 2)) % TEXTURE_SIZE
    in_joint = ((row % height) < joint) | ((shifted % width) < joint)
    shade = 1.0 + rng.uniform(-0.04, 0.04, (rows, 4))[row // height, shifted // width]
    return np.where(in_joint[..., None], np.asarray(record.rgb2), np.asarray(record.rgb) * shade[..., None])


def _planks(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Floor boards along the vertical axis, each with its own shade and grain."""
    boards = 4
    width = TEXTURE_SIZE // boards
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    board = column // width
    ends = (row + rng.integers(0, TEXTURE_SIZE, boards)[board]) % TEXTURE_SIZE
    in_joint = ((column % width) < 2) | (ends < 2)
    shade = 1.0 + rng.uniform(-0.12, 0.12, boards)[board]
    grain = _fourier_noise(rng, 1.2, (10.0, 1.0))
    wood = _mix(record.rgb, record.rgb2, 0.5 * grain) * shade[..., None]
    return np.where(in_joint[..., None], np.asarray(record.rgb2) * 0.6, wood)


def _plaster(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    return _mix(record.rgb, record.rgb2, 0.25 * _fourier_noise(rng, 1.1, (1.0, 1.0)))


def _metal(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Brushed along the horizontal axis."""
    return _mix(record.rgb, record.rgb2, 0.5 * _fourier_noise(rng, 0.7, (1.0, 25.0)))


GENERATORS = {
    "wood": _wood,
    "stone": _stone,
    "granite": _granite,
    "tile": _tile,
    "subway": _subway,
    "planks": _planks,
    "plaster": _plaster,
    "metal": _metal,
}


@functools.lru_cache(maxsize=256)
def texture_png(record: TextureRecord) -> bytes:
    """PNG bytes of a texture, RGB, 256x256 pixels, tileable.

    Raises:
        UnknownNameError: the record's kind has no generator.
    """
    if record.kind not in GENERATORS:
        raise UnknownNameError("texture kind", record.kind, GENERATORS)
    pixels = GENERATORS[record.kind](record, np.random.default_rng(record.seed))
    buffer = io.BytesIO()
    Image.fromarray(np.round(np.clip(pixels, 0.0, 1.0) * 255).astype(np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()
