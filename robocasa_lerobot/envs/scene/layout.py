"""Layouts: where the fixtures of a kitchen stand, read from a YAML file."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import yaml

from robocasa_lerobot.envs.scene.fixtures.appliances import Dishwasher, Fridge, Hood, Microwave, Range
from robocasa_lerobot.envs.scene.fixtures.base import Fixture
from robocasa_lerobot.envs.scene.fixtures.cabinets import TOE_KICK_M, Drawer, HingeCabinet, Plinth
from robocasa_lerobot.envs.scene.fixtures.counters import Counter, Sink
from robocasa_lerobot.envs.scene.fixtures.room import Canister, PaperTowel, Slab, Window
from robocasa_lerobot.errors import UnknownNameError

# Standard heights and depths, metres.
COUNTER_HEIGHT, COUNTER_THICKNESS, COUNTER_DEPTH = 0.92, 0.04, 0.65
BASE_DEPTH, BASE_HEIGHT = 0.62, COUNTER_HEIGHT - COUNTER_THICKNESS
WALL_CABINET_BOTTOM, WALL_CABINET_HEIGHT, WALL_CABINET_DEPTH = 1.45, 0.78, 0.36
DRAWER_DEPTH = 0.60
SPLASH_HEIGHT = WALL_CABINET_BOTTOM - COUNTER_HEIGHT
BASIN_SIZE = (0.58, 0.40, 0.18)
BASIN_FRONT_MARGIN = 0.075  # counter left in front of the basin
WALL_THICKNESS = 0.10

UNDER_COUNTER = ("cabinet", "drawers", "dishwasher", "sink")


@dataclass(frozen=True)
class Layout:
    """A kitchen's plan.

    Attributes:
        layout_id: file number.
        name: in a word or two.
        room: x_min, x_max, y_min (the back wall is y = 0) and height, metres.
        fixtures: by name, in the order in which they are added to the scene.
    """

    layout_id: int
    name: str
    room: dict[str, float]
    fixtures: dict[str, Fixture] = field(default_factory=dict)


def layout_ids() -> tuple[int, ...]:
    """Ids of the layouts that exist as files, ascending."""
    folder = resources.files("robocasa_lerobot.envs.scene") / "layouts"
    return tuple(sorted(int(f.name[7:10]) for f in folder.iterdir() if f.name.startswith("layout_")))


@functools.cache
def _record(layout_id: int) -> dict[str, Any]:
    if layout_id not in layout_ids():
        raise UnknownNameError("layout", str(layout_id), map(str, layout_ids()))
    file = resources.files("robocasa_lerobot.envs.scene") / "layouts" / f"layout_{layout_id:03d}.yaml"
    return yaml.safe_load(file.read_text())


def load_layout(layout_id: int) -> Layout:
    """Read a layout file and lay out its fixtures.

    Raises:
        UnknownNameError: there is no layout of that id, or it names an unknown fixture type.
    """
    record = _record(layout_id)
    fixtures = [
        *_room(record["room"]),
        *_base_row(record["base_row"]),
        *_wall_row(record["wall_row"]),
        *[Window(w["name"], (w["width"], 0.05, w["height"]), (w["x"], -0.025, w["z"])) for w in record["windows"]],
        *[_accessory(entry) for entry in record["counter_accessories"]],
    ]
    return Layout(layout_id, record["name"], record["room"], {fixture.name: fixture for fixture in fixtures})


def _room(room: dict[str, float]) -> list[Fixture]:
    x0, x1, y0, height = room["x_min"], room["x_max"], room["y_min"], room["height"]
    width, depth, t = x1 - x0, -y0, WALL_THICKNESS
    middle_x, middle_y = (x0 + x1) / 2, y0 / 2
    return [
        Slab("floor", (width, depth, 0.1), (middle_x, middle_y, -0.05), surface="floor"),
        Slab("wall_back", (width, t, height), (middle_x, t / 2, height / 2)),
        Slab("wall_left", (t, depth, height), (x0 - t / 2, middle_y, height / 2)),
        Slab("wall_right", (t, depth, height), (x1 + t / 2, middle_y, height / 2)),
    ]


def _base_row(row: dict[str, Any]) -> list[Fixture]:
    """Fixtures along the floor, and a counter over every unbroken run of those that carry one."""
    fixtures: list[Fixture] = []
    x = float(row["x_start"])
    run_start: float | None = None
    basin: Sink | None = None
    counters = 0
    for entry in [*row["fixtures"], {"type": "end", "width": 0.0}]:
        if entry["type"] not in UNDER_COUNTER and run_start is not None:
            counters += 1
            fixtures.append(_counter(f"counter_{counters}", run_start, x, basin))
            run_start, basin = None, None
        if entry["type"] in UNDER_COUNTER and run_start is None:
            run_start = x
        middle = x + entry["width"] / 2
        if entry["type"] == "sink":
            basin = _basin(entry["name"], middle)
        fixtures += _base_fixture(entry, middle, basin)
        x += entry["width"]
    return fixtures


def _base_fixture(entry: dict[str, Any], x: float, basin: Sink | None) -> list[Fixture]:
    kind, name, width = entry["type"], entry.get("name", ""), entry["width"]
    y = -BASE_DEPTH / 2
    if kind == "end":
        return []
    if kind == "fridge":
        return [Fridge(name, (width - 0.01, 0.74, 1.86), (x, -0.38, 0.93))]
    if kind == "dishwasher":
        return [Dishwasher(name, (width, BASE_DEPTH, BASE_HEIGHT), (x, y, BASE_HEIGHT / 2))]
    if kind == "range":
        return [Range(name, (width, COUNTER_DEPTH, COUNTER_HEIGHT), (x, -COUNTER_DEPTH / 2, COUNTER_HEIGHT / 2))]
    plinth = Plinth(f"{name}_plinth", (width, BASE_DEPTH, BASE_HEIGHT), (x, y, BASE_HEIGHT / 2))
    door_height = BASE_HEIGHT - TOE_KICK_M
    box = ((width, BASE_DEPTH, door_height), (x, y, TOE_KICK_M + door_height / 2))
    if kind == "cabinet":
        return [plinth, HingeCabinet(name, *box, doors=entry["doors"], hinge=entry.get("hinge", "left"))]
    if kind == "sink":
        assert basin is not None
        return [plinth, HingeCabinet(f"{name}_cabinet", *box, doors=2, hollow=True), basin]
    if kind == "drawers":
        plinth.closed_sides = True
        stack: list[Fixture] = [plinth]
        top = BASE_HEIGHT
        for index, height in enumerate(entry["heights"]):
            # The front is flush with cabinet doors; the box is shorter than the carcass is deep.
            position = (x, -BASE_DEPTH + DRAWER_DEPTH / 2, top - height / 2)
            stack.append(Drawer(f"{name}_drawer_{index + 1}", (width, DRAWER_DEPTH, height), position))
            top -= height
        return stack
    raise UnknownNameError("fixture type", kind, [*UNDER_COUNTER, "fridge", "range"])


def _basin(name: str, x: float) -> Sink:
    y = -COUNTER_DEPTH + BASIN_FRONT_MARGIN + BASIN_SIZE[1] / 2
    return Sink(name, BASIN_SIZE, (x, y, COUNTER_HEIGHT - BASIN_SIZE[2] / 2))


def _counter(name: str, x0: float, x1: float, basin: Sink | None) -> Counter:
    position = ((x0 + x1) / 2, -COUNTER_DEPTH / 2, COUNTER_HEIGHT - COUNTER_THICKNESS / 2)
    counter = Counter(name, (x1 - x0, COUNTER_DEPTH, COUNTER_THICKNESS), position, splash_height=SPLASH_HEIGHT)
    if basin is not None:
        cx, cy = basin.pos[0] - position[0], basin.pos[1] - position[1]
        half_w, half_d = basin.width / 2, basin.depth / 2
        counter.opening = (cx - half_w, cx + half_w, cy - half_d, cy + half_d)
    return counter


def _wall_row(row: dict[str, Any]) -> list[Fixture]:
    fixtures: list[Fixture] = []
    x = float(row["x_start"])
    for entry in row["fixtures"]:
        kind, width = entry["type"], entry["width"]
        middle = x + width / 2
        x += width
        bottom = entry.get("bottom", WALL_CABINET_BOTTOM)
        height = entry.get("height", WALL_CABINET_HEIGHT)
        depth = entry.get("depth", WALL_CABINET_DEPTH)
        if kind == "gap":
            continue
        if kind == "hood":
            fixtures.append(Hood(entry["name"], (width, 0.48, 0.95), (middle, -0.24, 1.62 + 0.475)))
            continue
        if kind != "cabinet":
            raise UnknownNameError("fixture type", kind, ["cabinet", "gap", "hood"])
        fixtures.append(
            HingeCabinet(
                entry["name"],
                (width, depth, height),
                (middle, -depth / 2, bottom + height / 2),
                doors=entry["doors"],
                hinge=entry.get("hinge", "left"),
                handle_at="bottom",
            )
        )
    return fixtures


ACCESSORIES: dict[str, type[Fixture]] = {"microwave": Microwave, "paper_towel": PaperTowel, "canister": Canister}


def _accessory(entry: dict[str, Any]) -> Fixture:
    if entry["type"] not in ACCESSORIES:
        raise UnknownNameError("fixture type", entry["type"], ACCESSORIES)
    width, depth, height = entry["size"]
    return ACCESSORIES[entry["type"]](
        entry["name"], (width, depth, height), (entry["x"], entry["y"], COUNTER_HEIGHT + height / 2)
    )
