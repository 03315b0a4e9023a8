"""What a blueprint says of an object: kinds, how many, how large, where, and how it is turned."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from robocasa_lerobot.envs.scene.spec import Placement

type Pos = list[float | str | None]
type Turn = tuple[float, float]


@dataclass(frozen=True)
class Category:
    """Of "all, -lemon", "one meat category", "kettle (kettle_non_electric)", "vegetable (washable)".

    Attributes:
        groups: that it is one of.
        exclude: that it is none of.
        brackets: the word in brackets: a kind, or a property.
    """

    groups: tuple[str, ...]
    exclude: tuple[str, ...]
    brackets: str


def category(text: str) -> Category:
    """What a blueprint calls the kinds of an object."""
    text = text.removesuffix(" (with visible liquid)")
    text = text.replace(" | ", ", ").removeprefix("another one of ").removesuffix(" (one, random)")
    text = re.sub(r"^any (\w+able)\b", r"any (\1)", text)
    text = re.sub(r"^any not \w+,", "any,", re.sub(r": category \w\b", "", text))
    text = re.sub(r"^one of | \((category \d, \w+|not that of \w+)\)", "", text)
    found = re.search(r" \((\w+)\)", text)
    words = re.sub(r"^one (\w+) category", r"\1", re.sub(r" \(\w+\)", "", text))
    words = re.sub(r"\ball\b", "any", words)
    kinds = [word.strip() for word in words.split(",")]
    return Category(
        tuple(kind for kind in kinds if not kind.startswith("-")),
        tuple(kind[1:] for kind in kinds if kind.startswith("-")),
        found.group(1) if found else "",
    )


def counted(said: int | str) -> tuple[int, int]:
    """Bounds of 2 or "1-3"."""
    low, _, high = str(said).partition("-")
    return int(low), int(high or low)


def per_axis(scale: float | str | list[float] | tuple[float, ...]) -> list[float]:
    """One factor, or three."""
    assert not isinstance(scale, str)
    return list(map(float, scale)) if isinstance(scale, list | tuple) else [float(scale)] * 3


def scale(placed: Any) -> list[float]:
    """Of a record, or of "scale 1.25", "scale 1.1,0.8,1", "scale z 2"."""
    if isinstance(placed, dict):
        return per_axis(placed.get("scale", 1.0))
    found = re.search(r"scale (z )?\[?([\d.,]+)", str(placed))
    if found is None:
        return per_axis(1.0)
    factors = [float(number) for number in found.group(2).strip(",.").split(",")]
    if found.group(1):
        return [1.0, 1.0, factors[0]]
    return per_axis(factors if len(factors) == 3 else factors[0])


def rectangle(placed: Any) -> tuple[list[float], Pos | None]:
    """Size, and position if it is said, of "region 0.35x0.35 m, pos (ref,-1)" and of records."""
    if isinstance(placed, list):
        return placed, None
    if isinstance(placed, dict):
        return placed.get("size", []), placed.get("pos")
    pos = re.search(r"pos \((-?[\w.]+),(-?[\w.]+)\)", placed) or re.search(r"x=\+?([-\d.]+) y=([-\d.]+)", placed)
    return lengths(placed), [_number_or_word(text) for text in pos.groups()] if pos else None


def offset(placed: Any) -> dict[int, float]:
    """By axis, of "offset x +0.1", "offset (+0.1,0)" and of records; axes that nothing is said of are left out."""
    if isinstance(placed, dict):
        return dict(enumerate(map(float, placed.get("offset", ()))))
    both = re.search(r"offset \(([-+\d.]+),([-+\d.]+)\)", str(placed))
    if both:
        return dict(enumerate(map(float, both.groups())))
    return {"xy".index(axis): float(by) for axis, by in re.findall(r"offset ([xy]) ([+-][\d.]+)", str(placed))}


def turn(at: str, placed: Any, kind: str = "") -> tuple[Turn, ...]:
    """Bounds of the turn, radians, of ours: one pair, or two if it may be to either side; none if nothing is said.

    To either side handles are turned: ours lie along -x, the original's along -y, a quarter turn from there. Those of
    our mugs lie along +x, a quarter turn to the other side.
    """
    back = np.pi / 2 if kind == "mug" else 0.0
    return tuple((low - back, high - back) for low, high in _turn(at, placed))


def _turn(at: str, placed: Any) -> tuple[Turn, ...]:
    text = f"{at} {placed}"
    if aside := _to_either_side(text):
        low, high = aside
        return (np.pi / 2 - high, np.pi / 2 - low), (np.pi / 2 + low, np.pi / 2 + high)
    if re.search(r"(turned|rotation) 90 deg|yaw pi/2|(\[|'rotation_rad': )1\.5708", text):
        return ((np.pi / 2, np.pi / 2),)
    if between := re.search(r"'rotation': \[(-?[\d.]+), (-?[\d.]+)\]", text):
        return ((_eighths(between.group(1)), _eighths(between.group(2))),)
    if "yaw pi/8 to pi/4" in text:
        return ((np.pi / 8, np.pi / 4),)
    if re.search(r"('rotation(_rad)?':|rotation|yaw) 0(?![.\d])", text):
        return ((0.0, 0.0),)
    if re.search(r"yaw pi(?!/)", text):
        return ((np.pi, np.pi),)
    assert not re.search("turned|yaw|rotation", text), f"a turn that cannot be read: {text}"
    return ()


def _eighths(text: str) -> float:
    """A number of radians; one of two digits that is an eighth of pi or several, rounded, is that."""
    said = float(text)
    exact = round(said / (np.pi / 8)) * np.pi / 8
    return exact if f"{exact:.2f}" == text else said


def _to_either_side(text: str) -> Turn | None:
    """By how much at least and at most, radians."""
    if re.search(r"45-67\.5 deg to either side|\+-\(pi/4\.\.3pi/8\)|-67\.5\.\.-45 or 45\.\.67\.5 deg", text):
        return np.pi / 4, 3 * np.pi / 8
    if both := re.search(r"\+-\(([\d.]+) to ([\d.]+)\)", text):
        return float(both.group(1)), float(both.group(2))
    both = re.search(r"\[\[-([\d.]+), -([\d.]+)\], \[\2, \1\]\]", text)
    return (float(both.group(2)), float(both.group(1))) if both else None


def is_turned(start: object, sides: tuple[Turn, ...]) -> bool:
    """Whether a placement turns by these alone; by none where it says nothing of its own."""
    ours = [start.rotation, start.other_rotation] if isinstance(start, Placement) else []
    ours = [] if ours == [Placement().rotation, None] else [side for side in ours if side is not None]
    return len(ours) == len(sides) and bool(np.allclose(sorted(ours), sorted(sides), rtol=0.0, atol=1e-3))


def greatest(text: str) -> tuple[float | None, float | None, float | None]:
    """Bounds of the size along x, y, z, metres, of "tool (height <= 0.10 m)", "food (footprint <= 0.15x0.15 m)"."""
    flat = re.search(r"footprint <= ([\d.]+)x([\d.]+) m", text)
    high = re.search(r"height <= ([\d.]+) m", text)
    return (
        float(flat.group(1)) if flat else None,
        float(flat.group(2)) if flat else None,
        float(high.group(1)) if high else None,
    )


def lengths(text: str) -> list[float]:
    """The first two lengths of a text such as "counter, >= 0.2x0.3 m"; none if it has none."""
    found = re.search(r"([\d.]+|full width )x ?([\d.]+)", text)
    return [WHOLE if number == "full width " else float(number) for number in found.groups()] if found else []


WHOLE = float("inf")  # the full width, which declarations may say as they do elsewhere


def _number_or_word(text: str) -> float | str | None:
    if text in ("any", "random"):
        return None
    return text if text == "ref" else float(text)
