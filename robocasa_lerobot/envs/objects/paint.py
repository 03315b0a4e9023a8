"""Colours and small patterns of objects, packed into one tiny texture per object.

A pattern is a uint8 picture (height, width, 3), its first row at the top (v = 1).
"""

from __future__ import annotations

import functools
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Rgb = tuple[float, float, float]
Pattern = NDArray[np.uint8]
Paint = Rgb | Pattern

_CELL = 4  # pixels of a plain colour in the texture
_WIDTH = 64


def bytes_of(rgb: Sequence[float]) -> tuple[int, int, int]:
    """Components in [0, 1] as 0..255."""
    r, g, b = (round(255 * min(max(float(c), 0.0), 1.0)) for c in rgb[:3])
    return r, g, b


def shade(rgb: Rgb, factor: float) -> Rgb:
    """The colour made lighter or darker."""
    return (min(rgb[0] * factor, 1.0), min(rgb[1] * factor, 1.0), min(rgb[2] * factor, 1.0))


def mix(a: Rgb, b: Rgb, share: float) -> Rgb:
    """`share` of colour b in colour a."""
    r, g, bl = (x * (1 - share) + y * share for x, y in zip(a, b, strict=True))
    return (r, g, bl)


def plain(rgb: Rgb, height: int = 32, width: int = 32) -> Pattern:
    """One colour."""
    return np.tile(np.array(bytes_of(rgb), np.uint8), (height, width, 1))


def gradient(colours: Sequence[Rgb], stops: Sequence[float] | None = None, height: int = 32, width: int = 8) -> Pattern:
    """Colours from the bottom to the top; `stops` in [0, 1] ascending."""
    where = np.linspace(0, 1, len(colours)) if stops is None else np.asarray(stops)
    v = np.linspace(1, 0, height)
    table = np.asarray(colours)
    column = np.column_stack([np.interp(v, where, table[:, i]) for i in range(3)])
    return np.round(np.repeat(column[:, None], width, axis=1) * 255).astype(np.uint8)


def bands(colours: Sequence[Rgb], stops: Sequence[float], height: int = 32, width: int = 4) -> Pattern:
    """Sharp bands from the bottom to the top: colour i up to stop i."""
    v = np.linspace(1, 0, height)
    index = np.minimum(np.searchsorted(np.asarray(stops), v), len(colours) - 1)
    rows = np.array([bytes_of(c) for c in colours], np.uint8)[index]
    return np.repeat(rows[:, None], width, axis=1)


def stripes(a: Rgb, b: Rgb, count: int, *, duty: float = 0.5, wobble: float = 0.0, seed: int = 0) -> Pattern:
    """Upright stripes around; `wobble` bends them."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.arange(64) / 64, np.arange(32) / 32)
    shift = wobble * sum(np.sin(2 * np.pi * (k * v + rng.random())) / k for k in (1, 2, 3))
    on = ((u * count + shift) % 1.0) < duty
    return np.where(on[..., None], np.array(bytes_of(b)), np.array(bytes_of(a))).astype(np.uint8)


def speckled(rgb: Rgb, dot: Rgb, density: float, seed: int, *, size: int = 32, blur: bool = False) -> Pattern:
    """Random dots of one colour on another; `blur` makes them patches."""
    rng = np.random.default_rng(seed)
    amount = rng.random((size, size))
    if blur:
        for axis in (0, 1):
            amount = (np.roll(amount, 1, axis) + amount + np.roll(amount, -1, axis)) / 3
        amount = (amount - amount.min()) / np.ptp(amount)
    on = amount < (np.quantile(amount, density) if blur else density)
    return np.where(on[..., None], np.array(bytes_of(dot)), np.array(bytes_of(rgb))).astype(np.uint8)


def netted(rgb: Rgb, line: Rgb, count: int, *, size: int = 48, width: float = 0.14) -> Pattern:
    """Diagonal net (pineapple, melon)."""
    u, v = np.meshgrid(np.arange(size) / size, np.arange(size) / size)
    on = (((u + v) * count) % 1.0 < width) | (((u - v) * count) % 1.0 < width)
    return np.where(on[..., None], np.array(bytes_of(line)), np.array(bytes_of(rgb))).astype(np.uint8)


def gridded(rgb: Rgb, line: Rgb, count: tuple[int, int], *, size: int = 48, width: float = 0.2) -> Pattern:
    """Upright grid of `count` cells (waffle, kernels of corn, woven basket)."""
    u, v = np.meshgrid(np.arange(size) / size, np.arange(size) / size)
    on = ((u * count[0]) % 1.0 < width) | ((v * count[1]) % 1.0 < width)
    return np.where(on[..., None], np.array(bytes_of(line)), np.array(bytes_of(rgb))).astype(np.uint8)


def canvas(rgb: Rgb, width: int = 48, height: int = 48) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """A picture of one colour to draw on."""
    image = Image.new("RGB", (width, height), bytes_of(rgb))
    return image, ImageDraw.Draw(image)


def pixels(image: Image.Image) -> Pattern:
    """The picture as a pattern."""
    return np.asarray(image, np.uint8)


@functools.cache
def _font() -> ImageFont.ImageFont:
    return ImageFont.load_default_imagefont()


def write(image: Image.Image, text: str, rgb: Rgb, box: tuple[float, float, float, float]) -> None:
    """Write words, one below the other, stretched into a box (left, top, right, bottom; shares of the picture)."""
    font = _font()
    lines = text.split("\n")
    width = max(round(font.getlength(line)) for line in lines)
    mask = Image.new("L", (width + 2, 11 * len(lines)), 0)
    draw = ImageDraw.Draw(mask)
    for i, line in enumerate(lines):
        draw.text(((width - font.getlength(line)) / 2 + 1, 11 * i), line, fill=255, font=font)
    left, top, right, bottom = (
        round(share * extent) for share, extent in zip(box, (image.width, image.height) * 2, strict=True)
    )
    mask = mask.resize((max(right - left, 1), max(bottom - top, 1)), Image.Resampling.BILINEAR)
    image.paste(Image.new("RGB", mask.size, bytes_of(rgb)), (left, top), mask)


def label(ground: Rgb, ink: Rgb, text: str, seed: int, *, around: int = 1, accent: Rgb = (0.95, 0.93, 0.86)) -> Pattern:
    """A printed label: bands, a patch with the words; repeated `around` times for round objects."""
    rng = np.random.default_rng(seed)
    image, draw = canvas(ground, 64 if around == 1 else 48, 48)
    w, h = image.size
    style = int(rng.integers(3))
    light = bytes_of(accent)
    if style == 0:
        draw.ellipse((w * 0.06, h * 0.14, w * 0.94, h * 0.86), fill=light)
    elif style == 1:
        draw.rectangle((0, h * 0.22, w, h * 0.78), fill=light)
    else:
        draw.rectangle((w * 0.07, h * 0.18, w * 0.93, h * 0.82), fill=light)
        draw.rectangle((0, h * 0.92, w, h), fill=light)
    # Of a round object little more than a third is seen at once.
    write(image, text, ink, (0.1, 0.3, 0.9, 0.7) if around == 1 else (0.22, 0.3, 0.78, 0.7))
    out = pixels(image)
    return out if around == 1 else np.tile(out, (1, around, 1))


@dataclass(frozen=True)
class Atlas:
    """A texture and where each paint lies in it.

    Attributes:
        png: the picture.
        places: (u0, v0, u1, v1) by paint.
    """

    png: bytes
    places: tuple[tuple[float, float, float, float], ...]


def pack(paints: Sequence[Paint]) -> Atlas:
    """Pack paints into one texture, row by row, the tallest first."""
    pictures = [p if isinstance(p, np.ndarray) else plain(p, _CELL, _CELL) for p in paints]
    width = max(_WIDTH, max(p.shape[1] for p in pictures))
    order = sorted(range(len(pictures)), key=lambda i: -pictures[i].shape[0])
    corners: dict[int, tuple[int, int]] = {}
    x = y = row = 0
    for i in order:
        h, w = pictures[i].shape[:2]
        if x + w > width:
            x, y, row = 0, y + row, 0
        corners[i] = (x, y)
        x, row = x + w, max(row, h)
    height = y + row
    out = np.zeros((height, width, 3), np.uint8)
    places = []
    for i, picture in enumerate(pictures):
        x, y = corners[i]
        h, w = picture.shape[:2]
        out[y : y + h, x : x + w] = picture
        inset = 0.5
        places.append(
            ((x + inset) / width, 1 - (y + h - inset) / height, (x + w - inset) / width, 1 - (y + inset) / height)
        )
    buffer = io.BytesIO()
    Image.fromarray(out).save(buffer, format="PNG", compress_level=1)
    return Atlas(buffer.getvalue(), tuple(places))
