"""Which parts of a counter, a drawer or a basin an object may start on, and what stands there already."""

from __future__ import annotations

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.regions import regions_of
from robocasa_lerobot.envs.kitchens.footprints import Area, Footprint, PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.scene.roles import counter_of, footprint
from robocasa_lerobot.envs.scene.spec import InsideOf, OnCounter

MIN_REGION_WIDTH_M = 0.12
# Fixture types that no object on a counter meets: shells, counters, flat fixtures on a wall. Boxes are parts of
# cabinets, but for those that stand on a counter as accessories.
NOT_OBSTACLES = ("counter", "floor", "wall", "window", "stool", "box", "panel_cabinet", "drawer")


def counter_areas(layout: Layout, start: OnCounter, near: Fixture) -> tuple[list[Area], list[Footprint]]:
    """The rectangles of the counter that a start allows, and what already stands on the counter."""
    counter = counter_of(layout, near)
    near_x = counter.to_local(near.pos)[0]
    width, depth = start.size
    shift_x, shift_y = start.offset
    if start.at == "front":
        y0 = -counter.depth / 2 + shift_y
        y1 = min(y0 + depth, counter.depth / 2)
    else:
        y1 = counter.depth / 2 - shift_y
        y0 = max(y1 - depth, -counter.depth / 2)
    half = near.width / 2
    spans = {
        "above": [(near_x - width / 2, near_x + width / 2)],
        "left_right": [(near_x - half - width, near_x - half), (near_x + half, near_x + half + width)],
    }[start.loc]
    areas = []
    for low, high in spans:
        x0, x1 = max(low + shift_x, -counter.width / 2), min(high + shift_x, counter.width / 2)
        if x1 - x0 >= MIN_REGION_WIDTH_M:
            areas.append(Area(x0, x1, y0, y1, counter.pos[:2], counter.yaw, counter.surface_z))
    if not areas:
        raise PlacementError(f"no room on {counter.name} near {near.name}")
    return areas, standing_on(layout, counter, counter.surface_z)


def standing_on(layout: Layout, fixture: Fixture, surface_z: float) -> list[Footprint]:
    """Footprints of the fixtures that stand on a surface of a fixture, or reach near it from above."""
    standing = [
        f
        for f in layout.fixtures.values()
        if f is not fixture
        and (f.stands_on_surface or layout.types[f.name] not in NOT_OBSTACLES)
        and f.pos[2] + f.height / 2 > surface_z - 0.005
        and f.pos[2] - f.height / 2 < surface_z + 0.3
    ]
    return [footprint(f) for f in standing] + [mark for f in standing for mark in _beside(f)]


def _beside(fixture: Fixture) -> list[Footprint]:
    """What a fixture covers of the counter outside its box, as the faucet of a sink does."""
    found = []
    for (x, y), half in fixture.covers_beside():
        at = fixture.to_world((x, y, 0.0))
        found.append(Footprint(float(at[0]), float(at[1]), fixture.yaw, half))
    return found


def inside_area(start: InsideOf, fixture: Fixture, openness: float) -> Area:
    """The part of a drawer's or basin's floor that a start allows, in the room as the drawer stands open."""
    region = regions_of(fixture)[0][1]
    half_w, half_d = min(start.size[0] / 2, region.half[0]), min(start.size[1] / 2, region.half[1])
    centre_y = region.center[1] + start.at * (region.half[1] - half_d)
    centre_y += fixture.slide_m(openness)
    centre = fixture.to_world((region.center[0], centre_y, region.center[2] - region.half[2]))
    return Area(-half_w, half_w, -half_d, half_d, (float(centre[0]), float(centre[1])), fixture.yaw, float(centre[2]))
