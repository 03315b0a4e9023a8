"""Rows of fixtures: along a wall, or back to back with the seats of an island."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.catalogue import (
    build_appliance,
    kinds_standing,
    model_for,
    standing_of,
)
from robocasa_lerobot.envs.kitchens.fixtures.accessories import SIZES, WALL_KINDS, make_accessory
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import (
    BOARD_M,
    TOE_KICK_M,
    Drawer,
    HingeCabinet,
    Housing,
    Panel,
    Plinth,
    Shelf,
)
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.hoods import Hood
from robocasa_lerobot.envs.kitchens.fixtures.room import Window
from robocasa_lerobot.envs.kitchens.materials import Style
from robocasa_lerobot.errors import UnknownNameError

# Standard heights and depths, metres.
COUNTER_HEIGHT, COUNTER_THICKNESS, COUNTER_DEPTH = 0.92, 0.04, 0.65
BASE_DEPTH, BASE_HEIGHT = 0.62, COUNTER_HEIGHT - COUNTER_THICKNESS
UPPER_BOTTOM, UPPER_HEIGHT, UPPER_DEPTH = 1.45, 0.78, 0.36
UPPER_TOP = UPPER_BOTTOM + UPPER_HEIGHT
TOWER_DEPTH = 0.65
DRAWER_DEPTH = 0.60
BRIDGE_BOTTOM = 1.92  # of cabinets over fridges
HOOD_BOTTOM, HOOD_DEPTH = 1.64, 0.46
WINDOW_BOTTOM, WINDOW_TOP = 1.12, 2.16
MICROWAVE_SHELF, MICROWAVE_SLOT, MICROWAVE_DEPTH = 1.40, 0.38, 0.46
TOWER_DRAWER_TOP = 0.52
SPLASH_M = 0.012
WALL_THICKNESS = 0.12
BASIN_FRONT_MARGIN = 0.075  # counter left in front of the basin
FRONT_HEIGHTS = {1: (0.78,), 2: (0.34, 0.44), 3: (0.18, 0.30, 0.30), 4: (0.18, 0.20, 0.20, 0.20)}

_CARRIES_COUNTER = ("cabinet", "open_cabinet", "drawers", "sink", "stovetop", "filler", "panel")
UPPER_TYPES = ("cabinet", "open_cabinet", "shelf", "bridge", "hood", "window", "microwave", "corner", "filler", "gap")


def carries_counter() -> tuple[str, ...]:
    """What of a row along the floor stands below a counter."""
    return (*_CARRIES_COUNTER, *kinds_standing("under_counter"))


def base_types() -> tuple[str, ...]:
    """What may stand in a row along the floor."""
    return (*carries_counter(), *kinds_standing("floor"), "tower", "corner", "gap")


@dataclass(frozen=True)
class Line:
    """Where a row runs: a point and a direction on the floor plan.

    Attributes:
        x, y: its left end at the wall, seen by someone who faces it; metres.
        yaw: of its fixtures, radians.
    """

    x: float
    y: float
    yaw: float

    def at(self, along: float, out: float, z: float) -> tuple[float, float, float]:
        """Room coordinates of a point `along` the line and `out` of the wall, metres."""
        c, s = float(np.cos(self.yaw)), float(np.sin(self.yaw))
        return (round(self.x + c * along + s * out, 6), round(self.y + s * along - c * out, 6), round(z, 6))


@dataclass
class Names:
    """Gives fixtures names that no other has: `cabinet_1`, `cabinet_2`, ..."""

    counts: dict[str, int] = field(default_factory=dict)

    def next(self, stem: str) -> str:
        """The next numbered name of a stem."""
        self.counts[stem] = self.counts.get(stem, 0) + 1
        return f"{stem}_{self.counts[stem]}"


@dataclass
class Row:
    """The fixtures of a row, and their fixture types.

    Attributes:
        line: where it runs.
        style: which appliance models, and which designs.
        names: of the whole layout.
        prefix: of every name, e.g. "island_".
        surfaces: roles of fronts and of the counter.
    """

    line: Line
    style: Style
    names: Names
    prefix: str = ""
    surfaces: tuple[str, str] = ("cabinet", "counter")
    fixtures: list[Fixture] = field(default_factory=list)
    types: dict[str, str] = field(default_factory=dict)
    windows: list[tuple[float, float]] = field(default_factory=list)  # spans along the line

    def add(self, kind: str, fixture: Fixture) -> Fixture:
        """Add a fixture of a fixture type."""
        self.fixtures.append(fixture)
        self.types[fixture.name] = kind
        return fixture

    def name(self, stem: str, *, single: bool = False) -> str:
        """A free name; single fixtures such as the sink are not numbered."""
        return self.prefix + stem if single else self.names.next(self.prefix + stem)

    def appliance(self, kind: str, along: float, back: float, bottom: float, name: str | None = None) -> Fixture:
        """Add the style's model of an appliance, its back `back` metres from the wall and standing at `bottom`."""
        model = model_for(self.style, kind)
        pos = self.line.at(along, back + model.size[1] / 2, bottom + model.size[2] / 2)
        return self.add(kind, build_appliance(model.model_id, name or self.name(kind, single=True), pos, self.line.yaw))


def entry_kind(entry: dict[str, Any], known: tuple[str, ...]) -> tuple[str, float]:
    """Type and width (metres) of a row's entry: its first key and value.

    Raises:
        UnknownNameError: the type is none of those known.
    """
    kind, width = next(iter(entry.items()))
    if kind not in known:
        raise UnknownNameError("fixture type", kind, known)
    return kind, float(width)


def total_width(entries: list[dict[str, Any]]) -> float:
    """Length that entries take along a row, metres."""
    return sum(float(next(iter(entry.values()))) for entry in entries)


def base_row(row: Row, entries: list[dict[str, Any]], start: float, depth: float = COUNTER_DEPTH) -> list[Counter]:
    """Add fixtures along the floor, and a counter of `depth` over every unbroken run of those that carry one."""
    counters: list[Counter] = []
    along = start
    run_start: float | None = None
    basin: Fixture | None = None
    for entry in [*entries, {"gap": 0.0}]:
        kind, width = entry_kind(entry, base_types())
        carries = kind in carries_counter()
        if not carries and run_start is not None:
            counters.append(_counter(row, row.name("counter"), run_start, along, depth, basin))
            run_start, basin = None, None
        if carries and run_start is None:
            run_start = along
        middle = along + width / 2
        if kind == "sink":
            basin = _sink(row, middle)
        elif kind == "corner":
            _corner(row, along, width)
            counters.append(_counter(row, row.name("counter_corner"), along, along + width, depth, None))
        _base_fixture(row, kind, entry, middle, width)
        along = round(along + width, 6)
    return counters


def _base_fixture(row: Row, kind: str, entry: dict[str, Any], middle: float, width: float) -> None:
    line, yaw, surface = row.line, row.line.yaw, row.surfaces[0]
    if kind in ("gap", "corner"):
        return
    if kind in kinds_standing("floor"):
        standing = standing_of(kind)
        row.appliance(kind, middle, standing.back_m, 0.0, row.prefix + (standing.name or kind))
        return
    if kind in kinds_standing("under_counter"):
        row.appliance(kind, middle, BASE_DEPTH - model_for(row.style, kind).size[1], 0.0)
        return
    if kind == "tower":
        _tower(row, entry, middle, width)
        return
    whole = ((width, BASE_DEPTH, BASE_HEIGHT), line.at(middle, BASE_DEPTH / 2, BASE_HEIGHT / 2), yaw)
    door_height = BASE_HEIGHT - TOE_KICK_M
    box = (
        (width, BASE_DEPTH, door_height),
        line.at(middle, BASE_DEPTH / 2, TOE_KICK_M + door_height / 2),
        yaw,
    )
    if kind in ("filler", "panel"):
        name = row.name(kind)
        row.add("box", Plinth(f"{name}_plinth", *whole, surface=surface))
        row.add("panel_cabinet", Panel(name, *box, surface=surface, plain=kind == "filler"))
    elif kind == "drawers":
        _drawers(row, row.name("stack"), entry.get("rows", 3), middle, width)
    elif kind == "stovetop":
        size = model_for(row.style, kind).size
        row.appliance(kind, middle, (COUNTER_DEPTH - size[1]) / 2 + 0.02, COUNTER_HEIGHT, row.prefix + "stove")
        _drawers(row, row.name("stack"), entry.get("rows", 2), middle, width)
    else:
        name = row.prefix + "sink_cabinet" if kind == "sink" else row.name("cabinet")
        row.add("box", Plinth(f"{name}_plinth", *whole, surface=surface))
        doors = 0 if kind == "open_cabinet" else entry.get("doors", 2 if width > 0.62 else 1)
        cabinet = HingeCabinet(name, *box, doors=doors, hinge=entry.get("hinge", "left"), surface=surface)
        cabinet.hollow = kind == "sink"
        row.add(_cabinet_type(doors), cabinet)


def _cabinet_type(doors: int) -> str:
    return ("open_cabinet", "single_cabinet", "hinge_cabinet")[doors]


def _drawers(row: Row, name: str, count: int, middle: float, width: float, top: float = BASE_HEIGHT) -> None:
    surface = row.surfaces[0]
    size, pos = (width, BASE_DEPTH, top), row.line.at(middle, BASE_DEPTH / 2, top / 2)
    row.add("box", Plinth(f"{name}_plinth", size, pos, row.line.yaw, closed_sides=True, surface=surface))
    heights = FRONT_HEIGHTS[count] if top == BASE_HEIGHT else ((top - TOE_KICK_M) / count,) * count
    for index, height in enumerate(heights):
        # The front is flush with cabinet doors; the box is shorter than the carcass is deep.
        position = row.line.at(middle, BASE_DEPTH - DRAWER_DEPTH / 2, top - height / 2)
        drawer = Drawer(f"{name}_drawer_{index + 1}", (width, DRAWER_DEPTH, height), position, row.line.yaw)
        drawer.surface = surface
        row.add("drawer", drawer)
        top -= height


def _corner(row: Row, along: float, width: float) -> None:
    """A closed box in the corner of two rows."""
    height = BASE_HEIGHT - TOE_KICK_M
    size = (width, BASE_DEPTH, height)
    pos = row.line.at(along + width / 2, BASE_DEPTH / 2, TOE_KICK_M + height / 2)
    row.add("panel_cabinet", Panel(row.name("panel_corner"), size, pos, row.line.yaw, surface=row.surfaces[0]))


def _sink(row: Row, middle: float) -> Fixture:
    model_id, size = model_for(row.style, "sink").model_id, model_for(row.style, "sink").size
    pos = row.line.at(middle, COUNTER_DEPTH - BASIN_FRONT_MARGIN - size[1] / 2, COUNTER_HEIGHT - size[2] / 2)
    return row.add("sink", build_appliance(model_id, row.prefix + "sink", pos, row.line.yaw))


def _counter(row: Row, name: str, x0: float, x1: float, depth: float, basin: Fixture | None) -> Counter:
    pos = row.line.at((x0 + x1) / 2, depth / 2, COUNTER_HEIGHT - COUNTER_THICKNESS / 2)
    counter = Counter(name, (x1 - x0, depth, COUNTER_THICKNESS), pos, row.line.yaw, surface=row.surfaces[1])
    if basin is not None:
        cx, cy = local_xy(counter, basin.pos)
        half_w, half_d = basin.width / 2, basin.depth / 2
        counter.opening = (cx - half_w, cx + half_w, cy - half_d, cy + half_d)
    row.add("counter", counter)
    return counter


def local_xy(fixture: Fixture, point: tuple[float, ...]) -> tuple[float, float]:
    """A point of the room in a fixture's frame, metres."""
    dx, dy = point[0] - fixture.pos[0], point[1] - fixture.pos[1]
    c, s = float(np.cos(fixture.yaw)), float(np.sin(fixture.yaw))
    return round(c * dx + s * dy, 6), round(-s * dx + c * dy, 6)


def _tower(row: Row, entry: dict[str, Any], middle: float, width: float) -> None:
    """A tall housing: drawers, then an oven, a microwave or both, then a cabinet."""
    line, yaw, surface = row.line, row.line.yaw, row.surfaces[0]
    stack: list[str] = entry["stack"]
    name = row.name("tower")
    _drawers(row, f"{name}_stack", 1, middle, width, top=TOWER_DRAWER_TOP)
    z, boards = TOWER_DRAWER_TOP + BOARD_M, []
    inner = width - 2 * BOARD_M
    for kind in stack:
        size = model_for(row.style, kind).size
        row.appliance(kind, middle, TOWER_DEPTH - 0.012 - size[1], z + 0.001)
        slot = MICROWAVE_SLOT if kind == "microwave" else size[2] + 0.006
        if kind == "oven" and inner - size[0] > 0.004:
            trim = (inner - size[0]) / 2
            for side in (-1, 1):
                pos = line.at(middle + side * (inner - trim) / 2, TOWER_DEPTH - 0.02, z + slot / 2)
                row.add("box", Panel(row.name(f"{name}_trim"), (trim, 0.02, slot), pos, yaw, surface=surface))
        z += slot
        boards.append(round(z + BOARD_M / 2, 6))
        z += BOARD_M
    bottom = TOWER_DRAWER_TOP
    housing = Housing(
        name,
        (width, TOWER_DEPTH, z - bottom),
        line.at(middle, TOWER_DEPTH / 2, (z + bottom) / 2),
        yaw,
        boards=tuple(boards[:-1]),
        surface=surface,
    )
    row.add("housing_cabinet", housing)
    rest = UPPER_TOP - z
    size = (width, TOWER_DEPTH, rest)
    doors = 2 if width > 0.62 else 1
    cabinet = HingeCabinet(f"{name}_stack_cabinet", size, line.at(middle, TOWER_DEPTH / 2, z + rest / 2), yaw)
    cabinet.doors, cabinet.handle_at, cabinet.surface = doors, "bottom", surface
    cabinet.shelves = 0 if rest < 0.4 else 1
    row.add(_cabinet_type(doors), cabinet)


def upper_row(row: Row, entries: list[dict[str, Any]], start: float, ceiling: float) -> None:
    """Add what hangs on the wall above the counter."""
    along = start
    for entry in entries:
        kind, width = entry_kind(entry, UPPER_TYPES)
        _upper_fixture(row, kind, entry, along + width / 2, width, ceiling)
        along = round(along + width, 6)


def _upper_fixture(row: Row, kind: str, entry: dict[str, Any], middle: float, width: float, ceiling: float) -> None:
    line, yaw = row.line, row.line.yaw
    if kind == "gap":
        return
    if kind == "window":
        row.windows.append((middle - width / 2, middle + width / 2))
        pane, inset = width - 0.16, WALL_THICKNESS
        size = (pane, inset, WINDOW_TOP - WINDOW_BOTTOM)
        pos = line.at(middle, -inset / 2, (WINDOW_TOP + WINDOW_BOTTOM) / 2)
        window = Window(row.name("window"), size, pos, yaw, columns=max(1, round(pane / 0.5)))
        window.rows = entry.get("rows", 1)
        row.add("window", window)
    elif kind == "hood":
        top = min(ceiling, UPPER_TOP if row.style.hood == "slim" else ceiling)
        size = (width - 0.02, HOOD_DEPTH, top - HOOD_BOTTOM)
        row.add("hood", Hood(row.prefix + "hood", size, line.at(middle, HOOD_DEPTH / 2, (top + HOOD_BOTTOM) / 2), yaw))
    elif kind == "microwave":
        _microwave_housing(row, middle, width)
    elif kind == "shelf":
        size = (width - 0.04, 0.26, UPPER_HEIGHT)
        middle_z = UPPER_BOTTOM + UPPER_HEIGHT / 2
        row.add("shelf", Shelf(row.name("shelf"), size, line.at(middle, 0.13, middle_z), yaw))
    elif kind in ("corner", "filler"):
        size = (width, UPPER_DEPTH, UPPER_HEIGHT)
        pos = line.at(middle, UPPER_DEPTH / 2, UPPER_BOTTOM + UPPER_HEIGHT / 2)
        row.add("panel_cabinet", Panel(row.name(f"upper_{kind}"), size, pos, yaw))
    else:
        over = kind == "bridge"
        bottom = BRIDGE_BOTTOM if over else entry.get("bottom", UPPER_BOTTOM)
        depth = 0.60 if over else UPPER_DEPTH
        height = UPPER_TOP - bottom
        doors = 0 if kind == "open_cabinet" else entry.get("doors", 2 if width > 0.55 else 1)
        name = row.name("bridge_stack" if over else "wall_cabinet")
        size, pos = (width, depth, height), line.at(middle, depth / 2, bottom + height / 2)
        cabinet = HingeCabinet(name, size, pos, yaw, doors=doors, hinge=entry.get("hinge", "left"))
        cabinet.handle_at = "bottom"
        cabinet.panel = entry.get("panel", row.style.upper_panel)
        cabinet.shelves = 0 if over else 1
        row.add(_cabinet_type(doors), cabinet)


def _microwave_housing(row: Row, middle: float, width: float) -> None:
    line, yaw = row.line, row.line.yaw
    name = row.name("microwave_housing")
    height = MICROWAVE_SLOT + 2 * BOARD_M
    z = MICROWAVE_SHELF + BOARD_M
    size = (width, MICROWAVE_DEPTH, height)
    row.add(
        "housing_cabinet", Housing(name, size, line.at(middle, MICROWAVE_DEPTH / 2, MICROWAVE_SHELF + height / 2), yaw)
    )
    deep = model_for(row.style, "microwave").size[1]
    row.appliance("microwave", middle, MICROWAVE_DEPTH - 0.012 - deep, z + 0.001)
    bottom = MICROWAVE_SHELF + height
    rest = UPPER_TOP - bottom
    pos = line.at(middle, MICROWAVE_DEPTH / 2, bottom + rest / 2)
    cabinet = HingeCabinet(f"{name}_stack_cabinet", (width, MICROWAVE_DEPTH, rest), pos, yaw)
    cabinet.doors, cabinet.handle_at, cabinet.shelves = (2 if width > 0.55 else 1), "bottom", 0
    cabinet.panel = row.style.upper_panel
    row.add(_cabinet_type(cabinet.doors), cabinet)


def counter_items(row: Row, items: list[dict[str, Any]]) -> None:
    """Add what stands on the row's counter: small appliances of the style, and accessories.

    An entry is a type and where its middle is along the row; `out` is the distance of its back from the wall (0.05),
    `turn` its turn in degrees, `z` the height of one that hangs.
    """
    for entry in items:
        kind, along = entry_kind(entry, (*kinds_standing("counter"), *SIZES))
        out, turn = float(entry.get("out", 0.05)), float(np.radians(entry.get("turn", 0.0)))
        if kind in kinds_standing("counter"):
            model = model_for(row.style, kind)
            pos = row.line.at(along, out + model.size[1] / 2, COUNTER_HEIGHT + model.size[2] / 2)
            row.add(kind, build_appliance(model.model_id, row.prefix + kind, pos, row.line.yaw + turn))
            continue
        depth = SIZES[kind][1]
        single = kind in ("dish_rack", "paper_towel")
        z = float(entry["z"]) - SIZES[kind][2] / 2 if kind in WALL_KINDS else COUNTER_HEIGHT
        out = SPLASH_M + 0.001 if kind in WALL_KINDS else out
        pos = row.line.at(along, out + depth / 2, z)
        name = row.name(kind, single=single)
        row.add(kind, make_accessory(kind, name, pos, row.line.yaw + turn))
