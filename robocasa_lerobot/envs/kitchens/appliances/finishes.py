"""What appliances are made of: named surfaces, of which the two splits have their own shades and textures."""

from __future__ import annotations

import functools

from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, Surface
from robocasa_lerobot.envs.kitchens.textures import Rgb, TextureRecord
from robocasa_lerobot.errors import UnknownNameError

# Enamel and plastic: colour and shininess.
_PAINTS: dict[str, tuple[Rgb, float]] = {
    "white": ((0.93, 0.93, 0.92), 0.5),
    "black": ((0.10, 0.10, 0.11), 0.6),
    "graphite": ((0.27, 0.28, 0.30), 0.45),
    "silver": ((0.70, 0.71, 0.73), 0.7),
    "cream": ((0.94, 0.88, 0.74), 0.6),
    "mint": ((0.64, 0.84, 0.76), 0.6),
    "red": ((0.72, 0.09, 0.09), 0.7),
    "sky": ((0.56, 0.74, 0.86), 0.6),
    "pink": ((0.93, 0.70, 0.73), 0.6),
    "sage": ((0.58, 0.66, 0.54), 0.5),
    "navy": ((0.13, 0.19, 0.33), 0.6),
    "mustard": ((0.83, 0.63, 0.18), 0.5),
    "copper": ((0.74, 0.45, 0.32), 0.8),
    "chrome": ((0.78, 0.79, 0.81), 0.95),
    "steel_plain": ((0.68, 0.69, 0.70), 0.8),
    "brass": ((0.76, 0.60, 0.30), 0.9),
    "bronze": ((0.36, 0.27, 0.20), 0.7),
    "ceramic": ((0.95, 0.95, 0.94), 0.8),
    "enamel": ((0.16, 0.16, 0.18), 0.6),
    "lining": ((0.90, 0.91, 0.92), 0.3),
    "cavity": ((0.50, 0.51, 0.52), 0.3),
    "rubber": ((0.06, 0.06, 0.06), 0.1),
    "wire": ((0.80, 0.80, 0.81), 0.8),
    "iron": ((0.13, 0.13, 0.13), 0.15),
    "screen": ((0.05, 0.07, 0.08), 0.9),
    "dark_glass": ((0.05, 0.05, 0.06), 0.95),
    "label": ((0.86, 0.86, 0.86), 0.2),
}
# Textured: kind, colour, second colour, scale in metres, shininess.
_TEXTURED: dict[str, tuple[str, Rgb, Rgb, float, float]] = {
    "steel": ("metal", (0.80, 0.81, 0.82), (0.64, 0.65, 0.67), 0.8, 0.7),
    "warm_steel": ("metal", (0.80, 0.78, 0.74), (0.66, 0.63, 0.59), 0.8, 0.7),
    "black_steel": ("metal", (0.30, 0.30, 0.32), (0.20, 0.20, 0.22), 0.8, 0.7),
    "granite_black": ("granite", (0.15, 0.15, 0.16), (0.32, 0.32, 0.33), 0.4, 0.4),
    "granite_grey": ("granite", (0.50, 0.51, 0.52), (0.34, 0.34, 0.36), 0.4, 0.4),
    "granite_sand": ("granite", (0.80, 0.74, 0.64), (0.60, 0.53, 0.44), 0.4, 0.4),
    "oak": ("wood", (0.72, 0.54, 0.34), (0.52, 0.36, 0.20), 0.3, 0.3),
}
# See-through, with opacity.
_CLEAR: dict[str, tuple[Rgb, float]] = {
    "glass": ((0.80, 0.88, 0.90), 0.28),
    "smoked_glass": ((0.10, 0.11, 0.12), 0.48),
    "shelf_glass": ((0.75, 0.85, 0.87), 0.45),
    "crisper": ((0.85, 0.90, 0.93), 0.50),
    "water_cold": ((0.55, 0.75, 0.95), 0.70),
    "water_hot": ((0.98, 0.72, 0.62), 0.70),
}
# Glowing: colour and strength of the light that they seem to give.
_LIGHTS: dict[str, tuple[Rgb, float]] = {
    "light_green": ((0.25, 1.00, 0.35), 0.9),
    "light_red": ((1.00, 0.16, 0.10), 0.9),
    "light_orange": ((1.00, 0.42, 0.08), 0.9),
    "light_blue": ((0.20, 0.50, 1.00), 0.9),
    "light_cyan": ((0.25, 0.95, 1.00), 0.8),
    "light_warm": ((1.00, 0.86, 0.55), 0.7),
    "flame": ((0.16, 0.42, 1.00), 0.9),
    "coffee": ((0.25, 0.13, 0.06), 0.1),
}
_TARGET_SHIFT = 0.025  # of colour components, so that the splits share no shade
_TARGET_SEED = 500


@functools.cache
def finish(name: str, split: str) -> Surface:
    """The surface of a finish in a split.

    Raises:
        UnknownNameError: no such finish.
    """
    if name in _TEXTURED:
        kind, rgb, rgb2, scale, shininess = _TEXTURED[name]
        seed = sorted(_TEXTURED).index(name) + 40 + (_TARGET_SEED if split == "target" else 0)
        texture = TextureRecord(kind, _shade(rgb, split), _shade(rgb2, split), seed, scale)
        return Surface(texture=texture, shininess=shininess, reflectance=0.05)
    if name in _PAINTS:
        rgb, shininess = _PAINTS[name]
        return Surface(rgba=(*_shade(rgb, split), 1.0), shininess=shininess)
    if name in _CLEAR:
        rgb, opacity = _CLEAR[name]
        return Surface(rgba=(*_shade(rgb, split), opacity), shininess=0.9)
    if name in _LIGHTS:
        rgb, emission = _LIGHTS[name]
        return Surface(rgba=(*_shade(rgb, split), 1.0), shininess=0.2, emission=emission)
    raise UnknownNameError("finish", name, [*_PAINTS, *_TEXTURED, *_CLEAR, *_LIGHTS])


def finish_names() -> tuple[str, ...]:
    """Every finish."""
    return (*_PAINTS, *_TEXTURED, *_CLEAR, *_LIGHTS)


def add_finish(palette: MaterialPalette, name: str, split: str) -> str:
    """Name of the finish's material, added when first asked for; appliances of a scene share it."""
    return palette.add(f"{split}_{name}", finish(name, split))


def _shade(rgb: Rgb, split: str) -> Rgb:
    shift = _TARGET_SHIFT if split == "target" else 0.0
    # Away from the nearer end, so that nothing is clipped.
    return (
        round(rgb[0] + (shift if rgb[0] < 0.5 else -shift), 3),
        round(rgb[1] + (shift if rgb[1] < 0.5 else -shift), 3),
        round(rgb[2] + (shift if rgb[2] < 0.5 else -shift), 3),
    )
