"""The tiles on the wall between counter and wall cabinets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco

from robocasa_lerobot.envs.kitchens.appliances.catalogue import kinds, standing_of
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, add_box
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette
from robocasa_lerobot.envs.kitchens.plan.fixture_rows import (
    COUNTER_HEIGHT,
    HOOD_BOTTOM,
    MICROWAVE_SHELF,
    SPLASH_M,
    UPPER_BOTTOM,
    UPPER_TOP,
    UPPER_TYPES,
    WINDOW_BOTTOM,
    Row,
    base_types,
    carries_counter,
    entry_kind,
)

Span = tuple[float, float, float]  # x min, x max and top, metres
_TOPS = {"window": WINDOW_BOTTOM - 0.07, "hood": HOOD_BOTTOM, "shelf": UPPER_TOP, "microwave": MICROWAVE_SHELF}


@dataclass
class Splash(Fixture):
    """Tiles on a wall, as high as what hangs above lets them be.

    Attributes:
        spans: in its own frame, from its middle and its underside.
    """

    spans: tuple[Span, ...] = ()

    def build(self, spec: mujoco.MjSpec, palette: MaterialPalette) -> None:
        """Add a panel for each span."""
        root = self.root_body(spec)
        material = palette("splashback")
        for x0, x1, top in self.spans:
            at = ((x0 + x1) / 2, 0, top / 2 - self.height / 2)
            add_box(root, at, (x1 - x0, self.depth, top), material, collide=False)


def add_splash(row: Row, plan: dict[str, Any]) -> None:
    """Add the tiles behind every unbroken run of counters and stoves of a row."""
    for x0, x1 in _runs(plan):
        tops = _tops(plan, x0, x1)
        height = max(top for _, _, top in tops) - COUNTER_HEIGHT
        spans = tuple((a - (x0 + x1) / 2, b - (x0 + x1) / 2, top - COUNTER_HEIGHT) for a, b, top in tops)
        pos = row.line.at((x0 + x1) / 2, SPLASH_M / 2, COUNTER_HEIGHT + height / 2)
        size = (x1 - x0, SPLASH_M, height)
        row.add("wall_accessory", Splash(row.name("splash"), size, pos, row.line.yaw, spans=spans))


def _runs(plan: dict[str, Any]) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    along, begun = float(plan.get("start", 0.0)), None
    for entry in [*plan.get("base", []), {"gap": 0.0}]:
        kind, width = entry_kind(entry, base_types())
        tiled = kind in (*carries_counter(), "corner") or (kind in kinds() and standing_of(kind).tiled)
        if tiled and begun is None:
            begun = along
        if not tiled and begun is not None:
            found.append((begun, along))
            begun = None
        along = round(along + width, 6)
    return found


def _tops(plan: dict[str, Any], x0: float, x1: float) -> list[Span]:
    """Parts of a run by the height that what hangs above them allows."""
    found: list[Span] = []
    along = float(plan.get("upper_start", plan.get("start", 0.0)))
    spans = []
    for entry in plan.get("upper", []):
        kind, width = entry_kind(entry, UPPER_TYPES)
        spans.append((along, along + width, _TOPS.get(kind, UPPER_BOTTOM)))
        along = round(along + width, 6)
    at = x0
    for a, b, top in spans:
        a, b = max(a, x0), min(b, x1)
        if b - a < 1e-6:
            continue
        if a > at + 1e-6:
            found.append((at, a, UPPER_BOTTOM))
        found.append((a, b, top))
        at = b
    if x1 > at + 1e-6:
        found.append((at, x1, UPPER_BOTTOM))
    merged: list[Span] = []
    for a, b, top in found:
        if merged and abs(merged[-1][2] - top) < 1e-9:
            merged[-1] = (merged[-1][0], b, top)
        else:
            merged.append((a, b, top))
    return merged
