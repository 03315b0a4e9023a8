"""What bottles and packages share: colours, profiles, bands for labels and their words."""

from __future__ import annotations

from robocasa_lerobot.envs.objects.draft import Draft
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    lathe,
)
from robocasa_lerobot.envs.objects.paint import (
    Rgb,
    bytes_of,
    canvas,
    mix,
    pixels,
    shade,
    write,
)

STEEL: Rgb = (0.78, 0.79, 0.81)


WHITE: Rgb = (0.95, 0.95, 0.93)


INK: Rgb = (0.12, 0.12, 0.16)


# Profiles (radius, height) as shares of half width and of the height below the cap, for each kind of bottle.
BOTTLES: dict[str, list[tuple[float, float]]] = {
    "wine": [
        (0, 0),
        (0.96, 0),
        (1, 0.02),
        (1, 0.58),
        (0.9, 0.66),
        (0.5, 0.74),
        (0.38, 0.78),
        (0.36, 0.97),
        (0.4, 0.98),
        (0.4, 1),
        (0, 1),
    ],
    "burgundy": [
        (0, 0),
        (0.96, 0),
        (1, 0.02),
        (1, 0.46),
        (0.8, 0.6),
        (0.42, 0.76),
        (0.36, 0.97),
        (0.4, 0.98),
        (0.4, 1),
        (0, 1),
    ],
    "beer": [
        (0, 0),
        (0.96, 0),
        (1, 0.02),
        (1, 0.56),
        (0.86, 0.66),
        (0.46, 0.8),
        (0.42, 0.97),
        (0.48, 0.98),
        (0.48, 1),
        (0, 1),
    ],
    "pet": [
        (0, 0),
        (0.8, 0),
        (0.98, 0.04),
        (1, 0.2),
        (0.93, 0.32),
        (0.93, 0.62),
        (1, 0.68),
        (0.9, 0.8),
        (0.45, 0.95),
        (0.42, 1),
        (0, 1),
    ],
    "water": [
        (0, 0),
        (0.82, 0),
        (0.98, 0.03),
        (1, 0.26),
        (0.9, 0.3),
        (0.98, 0.36),
        (0.98, 0.7),
        (0.86, 0.82),
        (0.42, 0.95),
        (0.4, 1),
        (0, 1),
    ],
    "squeeze": [
        (0, 0),
        (0.9, 0),
        (1, 0.03),
        (1, 0.3),
        (0.86, 0.5),
        (0.98, 0.72),
        (0.9, 0.88),
        (0.6, 0.98),
        (0.5, 1),
        (0, 1),
    ],
    "straight": [(0, 0), (0.96, 0), (1, 0.02), (1, 0.74), (0.92, 0.82), (0.5, 0.92), (0.46, 1), (0, 1)],
    "oil": [(0, 0), (0.96, 0), (1, 0.02), (1, 0.55), (0.9, 0.66), (0.42, 0.8), (0.34, 0.98), (0.4, 1), (0, 1)],
    "sauce": [(0, 0), (0.96, 0), (1, 0.02), (1, 0.5), (0.9, 0.62), (0.5, 0.84), (0.44, 1), (0, 1)],
    "honey": [
        (0, 0),
        (0.9, 0),
        (1, 0.05),
        (1, 0.4),
        (0.8, 0.5),
        (0.78, 0.54),
        (0.86, 0.66),
        (0.84, 0.8),
        (0.6, 0.94),
        (0.46, 1),
        (0, 1),
    ],
}


def around(radius: float, z0: float, z1: float, n: int = 14) -> Mesh:
    """A band around a round object, open above and below."""
    return lathe([(radius, z0), (radius, z1)], n)


def name_on(d: Draft, default: str = "") -> str:
    """The words of a label."""
    words = d.args.get("text", default or d.name.upper().replace("_", "\n"))
    return str(words[d.seed % len(words)] if isinstance(words, list) else words)


def shoulder(profile: list[tuple[float, float]]) -> float:
    """The height up to which a profile is nearly as wide as it gets."""
    return max(q for p, q in profile if p > 0.93)


def printed_box(d: Draft, size: tuple[float, float, float], words: str, *, picture: str = "", z: float = 0.0) -> None:
    """A carton with its front and back printed, the sides plain with a panel."""
    x, y, h = size
    dark = shade(d.colour, 0.7)
    image, draw = canvas(d.colour, 48, 64)
    draw.rectangle((0, 0, 48, 2), fill=bytes_of(dark))
    ink: Rgb = (0.98, 0.96, 0.9) if sum(d.colour) < 2.2 else (0.1, 0.2, 0.5)
    write(image, words, ink, (0.08, 0.05, 0.92, 0.3 if "\n" not in words else 0.44))
    top = 30
    if picture == "bowl":
        draw.pieslice((6, top - 12, 42, top + 26), 0, 180, fill=(245, 245, 245))
        for k in range(16):
            u, w = 9 + (k * 7) % 30, top + 2 + (k * 5) % 7
            draw.ellipse((u, w, u + 4, w + 4), fill=(214, 150, 50))
    elif picture == "pasta":
        draw.rectangle((8, top, 40, 60), fill=(238, 205, 120))
        for k in range(8, 41, 3):
            draw.line((k, top, k, 60), fill=(205, 160, 70))
    elif picture == "milk":
        draw.polygon([(14, top), (34, top), (31, 60), (17, 60)], fill=(250, 250, 250), outline=(90, 130, 190))
        draw.ellipse((2, top + 22, 13, 60), fill=(40, 42, 48))
        draw.ellipse((37, top + 6, 46, top + 18), fill=(40, 42, 48))
    elif picture == "fruit":
        draw.ellipse((10, top, 30, top + 20), fill=(240, 140, 30))
        draw.ellipse((22, top + 8, 40, top + 26), fill=(220, 60, 50))
    else:
        draw.rounded_rectangle((6, top, 42, 60), 6, fill=(245, 240, 226))
        draw.ellipse((13, top + 5, 35, top + 24), fill=bytes_of(mix(dark, (0.9, 0.6, 0.3), 0.6)))
    front = pixels(image)
    image2, draw2 = canvas(dark, 24, 32)
    draw2.rectangle((3, 6, 20, 27), fill=(240, 238, 230))
    for k in range(9, 26, 3):
        draw2.line((5, k, 18, k), fill=(120, 120, 120))
    side = pixels(image2)
    from robocasa_lerobot.envs.objects.mesh import sides_of_box

    center = (0, 0, z + h / 2)
    d.add(sides_of_box((x, y, h), (0, 1), center), front, "satin")
    d.add(sides_of_box((x, y, h), (2, 3), center), side, "satin")
    d.add(sides_of_box((x, y, h), (4, 5), center), dark, "satin")
