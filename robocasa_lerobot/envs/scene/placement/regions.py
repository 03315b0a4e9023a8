"""Where objects may start: tops and insides of fixtures as rectangles (docs/robocasa.md, section 6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, Region, of_kind
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.regions import region_names, regions_of
from robocasa_lerobot.envs.kitchens.footprints import Area, PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.scene.spec import Placement

# Shares of the ranges of an appliance's parts, by name.
type Shares = Mapping[str, float]

MIN_SIDE_M = 0.06  # parts narrower than this are no use


@dataclass(frozen=True)
class Part:
    """A part of a fixture that objects can stand on: a rectangle in the frame of the fixture.

    Attributes:
        area: its bounds, height and free height.
        fixture: name.
        name: of the region, if it is one.
    """

    area: Area
    fixture: str
    name: str = ""


def parts_of(layout: Layout, fixture: Fixture, openness: float | Shares = 0.0) -> list[Part]:
    """The parts of a fixture that objects can stand on or in, in its own order, drawers and racks as they stand open.

    Counters have a rectangle on each side of an opening and the strips before and behind it.
    """
    if isinstance(fixture, Counter):
        return [
            Part(_area(fixture, rectangle, fixture.surface_z, fixture.name), fixture.name)
            for rectangle in fixture.solid_rectangles()
        ]
    found = []
    for name, region in regions_of(fixture):
        x, y, z = _region_frame(layout, fixture, region, openness)
        half = region.half
        rectangle = (x - half[0], x + half[0], y - half[1], y + half[1])
        area = _area(fixture, rectangle, z - half[2], f"{fixture.name} ({name})")
        found.append(Part(replace(area, height=2 * half[2]), fixture.name, name))
    return found


def _area(fixture: Fixture, rectangle: tuple[float, float, float, float], z: float, name: str) -> Area:
    x0, x1, y0, y1 = rectangle
    return Area(x0, x1, y0, y1, (fixture.pos[0], fixture.pos[1]), fixture.yaw, z, name)


def _region_frame(
    layout: Layout, fixture: Fixture, region: Region, openness: float | Shares
) -> tuple[float, float, float]:
    """Middle of a region: x and y in the fixture's frame, z in the room."""
    center = np.asarray(region.center)
    if region.body != fixture.name:
        center = center + _part_offset(layout.style_id, fixture, region.body, openness)
    return float(center[0]), float(center[1]), float(center[2] + fixture.pos[2])


def _part_offset(style_id: int, fixture: Fixture, body: str, openness: float | Shares) -> np.ndarray:
    """Where a moving part of a fixture is, in the fixture's frame: from a model of the fixture alone."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    alone = replace(fixture, pos=(0.0, 0.0, 0.0), yaw=0.0)
    alone.build(spec, MaterialPalette(spec, load_style(style_id), textures=False))
    model = spec.compile()
    data = mujoco.MjData(model)
    if isinstance(openness, Mapping):
        for part, share in openness.items():
            of_kind(alone, Appliance).set_share(data, part, share)
    elif openness:
        alone.set_openness(data, openness)
    mujoco.mj_kinematics(model, data)
    return np.asarray(data.body(body).xpos.copy())


def choose_parts(
    layout: Layout, placement: Placement, fixture: Fixture, ref: Fixture | None, openness: float | Shares
) -> list[Part]:
    """The parts of a fixture that a placement allows.

    Raises:
        PlacementError: none.
    """
    region = placement.region
    low, high = region.height
    names = region_names(fixture, region.name)
    parts = [
        part
        for part in parts_of(layout, fixture, openness)
        if part.name.startswith(names)
        and low <= part.area.z <= high
        and (placement.slot or min(_sides(part.area)) >= MIN_SIDE_M)
    ]
    if region.level is not None:
        parts.sort(key=lambda part: part.area.z)
        level = int(region.level)
        parts = parts[level:][:1] if level != -1 else parts[-1:]
    wide, deep = region.top_size
    parts = [p for p in parts if p.area.x1 - p.area.x0 >= wide - 1e-9 and p.area.y1 - p.area.y0 >= deep - 1e-9]
    if ref is not None:
        parts = _near(parts, fixture, ref, region.loc)
    if not parts:
        raise PlacementError(
            f"{fixture.name} has no part of {wide:.2f} x {deep:.2f} m with its floor at {low:.2f} to {high:.2f} m"
            + (f" {region.loc} of {ref.name}" if ref is not None else "")
            + ". Ask for a smaller part, for other heights, or for another fixture."
        )
    return parts


def _sides(area: Area) -> tuple[float, float]:
    return area.x1 - area.x0, area.y1 - area.y0


def _near(parts: list[Part], fixture: Fixture, ref: Fixture, loc: str) -> list[Part]:
    at = fixture.to_local(ref.pos)[0]
    if loc == "nn":
        return sorted(parts, key=lambda part: _gap(part, at))[:1]
    if loc == "any":
        return parts
    found = []
    for side in ("left", "right") if loc == "left_right" else (loc,):
        edge = at - ref.width / 2 if side == "left" else at + ref.width / 2
        cut = []
        for part in parts:
            area = part.area
            x0, x1 = (area.x0, min(area.x1, edge)) if side == "left" else (max(area.x0, edge), area.x1)
            if x1 - x0 >= MIN_SIDE_M:
                cut.append(Part(replace(area, x0=x0, x1=x1), part.fixture))
        # The nearest on that side, of those that reach deepest: not the strips beside an opening.
        found += sorted(cut, key=lambda part: (_gap(part, edge), part.area.y0 - part.area.y1))[:1]
    return found


def _gap(part: Part, at: float) -> float:
    return max(part.area.x0 - at, at - part.area.x1, 0.0)


def rectangle_in(part: Part, placement: Placement, fixture: Fixture, ref: Fixture | None) -> Area:
    """The rectangle of a part that a placement's size, position, offset and margin leave.

    Positions are normalised: -1 and 1 put the rectangle flush with the part's edges.
    """
    area = part.area
    bounds = []
    ref_at = (0.0, 0.0) if ref is None else fixture.to_local(ref.pos)
    for axis, (low, high) in enumerate(((area.x0, area.x1), (area.y0, area.y1))):
        wide = high - low
        side = wide if placement.size is None else min(placement.size[axis], wide)
        where = placement.pos[axis]
        if where is None:
            bounds.append((low, high))
            continue
        if isinstance(where, str):
            middle = float(np.clip(ref_at[axis], low + side / 2, high - side / 2))
        else:
            middle = (low + high) / 2 + where * (wide - side) / 2
        shift = placement.offset[axis]
        bounds.append((max(middle - side / 2 + shift, low), min(middle + side / 2 + shift, high)))
    margin = min(placement.margin, *((high - low) / 4 for low, high in bounds))
    (x0, x1), (y0, y1) = bounds
    if min(x1 - x0, y1 - y0) <= 0:
        raise PlacementError(
            f"the offset {placement.offset} pushes the region off {area.name}. Ask for a smaller offset, for another "
            "position, or for another fixture."
        )
    return replace(
        area,
        x0=x0 + margin,
        x1=x1 - margin,
        y0=y0 + margin,
        y1=y1 - margin,
        rotation=placement.rotation,
        inside=placement.ensure_inside,
    )
