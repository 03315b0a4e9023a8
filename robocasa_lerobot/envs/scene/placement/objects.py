"""Puts the objects of a task where they start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.footprints import Area, Footprint, PlacementError, place
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.envs.scene.drawn import PlacedObject
from robocasa_lerobot.envs.scene.placement.counter_areas import counter_areas, inside_area, standing_on
from robocasa_lerobot.envs.scene.placement.regions import Part, Shares, choose_parts, rectangle_in
from robocasa_lerobot.envs.scene.robot_poses import OpenDoor
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.envs.scene.spec import ObjectSpec, OnCounter, Placement
from robocasa_lerobot.envs.scene.task_parameters import item_of, name_of, number_of, start_of
from robocasa_lerobot.envs.scene.words import numbered

PLACEMENT_GAP_M = 0.004  # objects start this far above their surface and settle
SHALLOW_M = 0.025  # vessels up to this deep are plates: what lies within their edge starts on their floor
_HANDLE_SHARE = 0.4  # of the way from the middle of a pan's inside to that of its length, where its weight is
_TURNS = 20  # how often a place is drawn for what hardly fits into a compartment
IN_CONTAINER = "in_container"  # object group of what may stand in a container


@dataclass
class _Table:
    """Where objects have been put so far.

    Attributes:
        placed: objects by name.
        taken: their footprints.
        parts: which part of a fixture each object stands on; before it does, those that it may.
        holders: names of the containers that were put under objects.
    """

    placed: dict[str, PlacedObject] = field(default_factory=dict)
    taken: list[tuple[Footprint, float]] = field(default_factory=list)
    parts: dict[str, list[Part]] = field(default_factory=dict)
    holders: set[str] = field(default_factory=set)

    def near(self, z: float) -> list[Footprint]:
        """Footprints of what stands at about a height (metres), or on something there."""
        return [footprint for footprint, height in self.taken if abs(height - z) < 0.15]


def place_objects(
    rng: np.random.Generator,
    task: SceneSpec,
    split: str,
    layout: Layout,
    roles: dict[str, str],
    openness: Mapping[str, float | Shares],
    choices: Mapping[str, str] = MappingProxyType({}),
    doors: Sequence[OpenDoor] = (),
) -> dict[str, PlacedObject]:
    """Draw the objects of a task and put them down, in the order in which they are declared; not in open `doors`.

    Raises:
        PlacementError: something has no free place.
    """
    table = _Table()
    for number, wanted in enumerate(task.objects, start=1):
        for index in range(number_of(rng, wanted, choices)):
            items = {name: placed.item for name, placed in table.placed.items() if name not in table.holders}
            item = item_of(rng, wanted, index, split, items, choices, task.objects[number:])
            start = start_of(rng, wanted, choices)
            asked, name = replace(wanted, start=start), name_of(wanted, index)
            _put(rng, table, asked, name, item, split, layout, roles, openness, doors)
    return table.placed


def _put(
    rng: np.random.Generator,
    table: _Table,
    wanted: ObjectSpec,
    name: str,
    item: catalogue.Instance,
    split: str,
    layout: Layout,
    roles: dict[str, str],
    openness: Mapping[str, float | Shares],
    doors: Sequence[OpenDoor],
) -> None:
    start = wanted.start
    standing: list[Footprint] = []
    rooms: list[Area] = []
    must, below = False, None
    if isinstance(start, OnCounter):
        areas, standing = counter_areas(layout, start, layout.fixtures[roles[start.near]])
        standing = [*standing, *_in_the_air(doors, areas[0].z, item)]
    elif not isinstance(start, Placement):
        fixture = layout.fixtures[roles[start.fixture]]
        share = openness.get(fixture.name, 0.0)
        assert isinstance(share, float)
        areas = [inside_area(start, fixture, share)]
    elif start.object:
        _put_on(rng, table, name, item, table.placed[start.object], start)
        return
    else:
        fixture = below = layout.fixtures[roles[start.fixture]]
        areas = _areas(table, name, start, fixture, layout, roles, openness)
        if start.slot:
            areas = [_in_slot(area, item) for area in areas]
        # What stands around a compartment is not in it.
        inside = any(part.name for part in table.parts[name])
        standing = [] if inside else [*standing_on(layout, fixture, areas[0].z), *_in_the_air(doors, areas[0].z, item)]
        if start.try_to_place_in and IN_CONTAINER in _groups_of(item):
            container = catalogue.sample(rng, (start.try_to_place_in,), split)
            holder = f"{name}_container"
            table.holders.add(holder)
            chosen = _put_down(rng, table, holder, container, areas, standing, below=below)
            table.parts[name] = [table.parts[name][chosen]]
            # What may stick out is the container: an object across its rim would tip over.
            _put_on(rng, table, name, item, table.placed[holder], replace(start, ensure_inside=True))
            return
        must = fixture.holds_all_of_it and start.ensure_inside
        # Of open compartments an object may stick out, as the handle of a mug does under a spout.
        if must or (inside and fixture.door_names and start.ensure_inside and not start.slot):
            rooms = [part.area for part in table.parts[name]]
    lying = isinstance(start, Placement) and start.lying
    chosen = _put_down(rng, table, name, item, areas, standing, rooms, must=must, lying=lying, below=below)
    if name in table.parts:
        table.parts[name] = [table.parts[name][chosen]]


def _in_the_air(doors: Sequence[OpenDoor], z: float, item: catalogue.Instance) -> list[Footprint]:
    """Open doors that something of an item's height would meet, if it stood at a height (metres)."""
    return [door.footprint for door in doors if door.low < z + max(item.size) and door.high > z]


def _in_slot(area: Area, item: catalogue.Instance) -> Area:
    """A slot, in which the item's longer side lies along the slot's, and whose top is open."""
    crossed = (area.x1 - area.x0 > area.y1 - area.y0) != (item.size[0] > item.size[1])
    low, high = area.rotation
    turn = np.pi / 2 if crossed else 0.0
    return replace(area, height=np.inf, rotation=(low + turn, high + turn))


def _groups_of(item: catalogue.Instance) -> set[str]:
    """Groups of an object's category, with those that are made of others."""
    found = set(item.category.groups)
    if IN_CONTAINER in catalogue.GROUPS and item.category in catalogue.categories_of(IN_CONTAINER):
        found.add(IN_CONTAINER)
    return found


def _areas(
    table: _Table,
    name: str,
    start: Placement,
    fixture: Fixture,
    layout: Layout,
    roles: dict[str, str],
    openness: Mapping[str, float | Shares],
) -> list[Area]:
    region = start.region
    ref = layout.fixtures[roles[region.ref]] if region.ref else None
    again = numbered(start.reuse_region_from, table.parts) if start.reuse_region_from else []
    assert again or name.startswith(f"{start.reuse_region_from}_") or not start.reuse_region_from, start
    if again:
        parts = table.parts[again[0]]
    else:
        parts = choose_parts(layout, start, fixture, ref, openness.get(fixture.name, 0.0))
    table.parts[name] = parts
    return [rectangle_in(part, start, fixture, ref) for part in parts]


def _put_down(
    rng: np.random.Generator,
    table: _Table,
    name: str,
    item: catalogue.Instance,
    areas: list[Area],
    standing: list[Footprint],
    rooms: Sequence[Area] = (),
    *,
    must: bool = False,
    lying: bool = False,
    below: Fixture | None = None,
) -> int:
    """Put an object onto one of the areas, whose number is given.

    If `rooms` are given, it is put so that it is wholly in one, which it `must` or can.

    It must in basins and drawers. In a compartment behind a door it is pushed in where it would stick out. It stands
    without tipping on the fixture `below`, if it can.
    """
    width, depth, height = item.size
    if lying:
        depth, height = height, depth
    high = [area for area in areas if area.height > height + PLACEMENT_GAP_M]
    what = f"{name} ({item.model})"
    if not high:
        raise PlacementError(
            f"{what} is {height:.2f} m high, and {areas[0].name} has {max(a.height for a in areas):.2f} m. Ask for a "
            "lower object, for a higher part, or for another fixture."
        )
    half = (width / 2, depth / 2)

    def occupied(area: Area) -> list[Footprint]:
        """What stands at the area's own height; and, as ever, at that of the first, though it may lie elsewhere."""
        heights = {high[0].z, area.z}
        marks = dict.fromkeys(mark for z in sorted(heights) for mark in table.near(z))
        return [*marks, *standing]

    middle = (0.0, 0.0) if item.interior is None else item.interior.center[:2]
    for _ in range(_TURNS):
        footprint, area = place(rng, high, half, occupied, what=what, middle=middle)
        if below is not None and not below.bears(*below.to_local(_weight_of(footprint, middle))):
            continue
        if not rooms or any(room.holds(footprint) for room in rooms):
            break
        if not must and (pushed := _pushed_in(footprint, area, rooms, occupied(area))):
            footprint = pushed
            break
    else:
        if must:
            raise PlacementError(
                f"{what} of {width:.2f} x {depth:.2f} m does not lie in {rooms[0].name} without touching its walls. "
                "Ask for a smaller object, or for another fixture."
            )
    table.taken.append((footprint, area.z))
    z = area.z + height / 2 + PLACEMENT_GAP_M
    table.placed[name] = PlacedObject(name, item, (footprint.x, footprint.y, z), footprint.yaw, area.middle, lying)
    return next(number for number, one in enumerate(areas) if one is area)


def _weight_of(footprint: Footprint, middle: tuple[float, float]) -> tuple[float, float]:
    """About where the middle of mass of a vessel is, in the room: its handle draws it off the middle of its inside."""
    x, y = np.array([footprint.x, footprint.y]) + (1 - _HANDLE_SHARE) * np.array(middle) @ footprint.axes()
    return float(x), float(y)


def _pushed_in(
    footprint: Footprint, area: Area, rooms: Sequence[Area], occupied: Sequence[Footprint]
) -> Footprint | None:
    """A footprint drawn in an area, shifted so that it lies in the room of the area; None if that is not free."""
    room = next(room for room in rooms if room.name == area.name)
    inside = room.pushed_in(footprint)
    return None if inside is None or any(inside.overlaps(other, 0.01) for other in occupied) else inside


def _put_on(
    rng: np.random.Generator,
    table: _Table,
    name: str,
    item: catalogue.Instance,
    holder: PlacedObject,
    start: Placement,
) -> None:
    """Put an object into, or onto, one that was placed: on the floor of its inside, on its rim, or on its top."""
    x, y, z = holder.pos
    inside = getattr(holder.item, "interior", None)
    if inside is not None:
        (cx, cy, cz), half = inside.center, inside.half
        floor = z + cz - half[2]
    else:
        (cx, cy), half = (0.0, 0.0), (0.35 * holder.item.size[0], 0.35 * holder.item.size[1], 0.0)
        floor = z + holder.item.size[2] / 2
    area = Area(cx - half[0], cx + half[0], cy - half[1], cy + half[1], (x, y), holder.yaw, floor, holder.name)
    area = replace(area, rotation=start.rotation, inside=start.ensure_inside)
    width, depth, height = item.size
    what = f"{name} ({item.model})"
    rim = z + holder.item.size[2] / 2 if inside is not None else floor
    if start.heaped:
        footprint, top = _on_heap(rng, table, area, (width / 2, depth / 2), holder, what)
        footprint, lowest = _let_down(table, footprint, area, holder, rim, height)
        top = max(top, lowest)
        at = (footprint.x, footprint.y, top + height / 2 + PLACEMENT_GAP_M)
        table.placed[name] = PlacedObject(name, item, at, footprint.yaw, holder.region_middle, let_down_m=top - floor)
        return
    others = [
        p.footprint
        for other, p in table.placed.items()
        if other != holder.name and abs(p.pos[2] - p.item.size[2] / 2 - floor) < 0.03
    ]
    footprint, _ = place(rng, [area], (width / 2, depth / 2), others, margin=0.002, what=what)
    footprint, lowest = _let_down(table, footprint, area, holder, rim, height)
    at = (footprint.x, footprint.y, lowest + height / 2 + PLACEMENT_GAP_M)
    table.placed[name] = PlacedObject(name, item, at, footprint.yaw, holder.region_middle, let_down_m=lowest - floor)
    table.taken.append((footprint, lowest))


def _let_down(
    table: _Table, footprint: Footprint, area: Area, holder: PlacedObject, rim: float, height: float
) -> tuple[Footprint, float]:
    """Where an object of a height is let go over a vessel's inside, and from how high in the room, metres.

    On the floor, where it lies within the walls. They would throw it out or keep it wedged where it lies across them:
    then from the rim, or what lies there already, and in the middle of a vessel that is no plate.
    """
    if area.holds(footprint):
        return footprint, area.z
    if rim > area.z + min(height, SHALLOW_M):
        x, y = area.middle
        footprint = replace(footprint, x=x, y=y)
        return footprint, max([rim, *_tops_under(table, footprint, area, holder)])
    far = np.hypot(*(footprint.corners() - holder.pos[:2]).T).max()
    return footprint, rim if far > min(holder.item.size[:2]) / 2 else area.z


def _on_heap(
    rng: np.random.Generator, table: _Table, area: Area, half: tuple[float, float], holder: PlacedObject, what: str
) -> tuple[Footprint, float]:
    """The lowest of several places on what a holder has in it already, and the height there, metres."""
    best: tuple[Footprint, float] | None = None
    for _ in range(_TURNS):
        footprint, _ = place(rng, [area], half, [], what=what)
        floor = max([area.z, *_tops_under(table, footprint, area, holder)])
        if best is None or floor < best[1]:
            best = footprint, floor
    assert best is not None
    return best


def _tops_under(table: _Table, footprint: Footprint, area: Area, holder: PlacedObject) -> list[float]:
    """Heights in the room of what a holder has in it already, where a footprint lies over it, metres."""
    others = [other for other in table.placed.values() if other is not holder and other.pos[2] > area.z]
    return [other.pos[2] + other.item.size[2] / 2 for other in others if other.footprint.overlaps(footprint)]
