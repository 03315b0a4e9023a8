"""Layouts: where the fixtures of a kitchen stand, read from a YAML file and furnished with a style's appliances.

A layout is made of rows of fixtures, each along a wall or an island. See `layouts/README.md` for the files.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import numpy as np
import yaml

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.materials import Style, load_style
from robocasa_lerobot.envs.kitchens.plan.backsplash import add_splash
from robocasa_lerobot.envs.kitchens.plan.fixture_rows import Line, Names, Row, base_row, counter_items, upper_row
from robocasa_lerobot.envs.kitchens.plan.islands import add_island, add_table
from robocasa_lerobot.envs.kitchens.plan.room import add_room
from robocasa_lerobot.errors import UnknownNameError

WALLS = ("back", "left", "right", "front")


@dataclass(frozen=True)
class Layout:
    """A kitchen's plan with the fixtures of a style.

    Attributes:
        layout_id, style_id: file numbers.
        name: in a few words.
        plan: "one_wall", "L", "U", "G", "galley", "peninsula" or "island".
        room: x_min, x_max, y_min (the back wall is y = 0) and height, metres.
        fixtures: by name, in the order in which they are added to the scene.
        types: fixture type of each fixture, by name.
    """

    layout_id: int
    style_id: int
    name: str
    plan: str
    room: dict[str, float]
    fixtures: dict[str, Fixture] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)

    def of_type(self, *types: str) -> list[Fixture]:
        """Fixtures of any of some fixture types, in the layout's order."""
        return [fixture for name, fixture in self.fixtures.items() if self.types[name] in types]


def layout_ids() -> tuple[int, ...]:
    """Ids of the layouts that exist as files, ascending."""
    folder = resources.files(__package__) / "layouts"
    return tuple(sorted(int(f.name[7:10]) for f in folder.iterdir() if f.name.startswith("layout_")))


@functools.cache
def layout_record(layout_id: int) -> dict[str, Any]:
    """The content of a layout file.

    Raises:
        UnknownNameError: there is no layout of that id.
    """
    if layout_id not in layout_ids():
        raise UnknownNameError("layout", str(layout_id), map(str, layout_ids()))
    file = resources.files(__package__) / "layouts" / f"layout_{layout_id:03d}.yaml"
    record: dict[str, Any] = yaml.load(file.read_text(), Loader=_LOADER)
    return record


_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def load_layout(layout_id: int, style_id: int | None = None) -> Layout:
    """Read a layout file and lay out its fixtures, with the appliances of a style (that of the same number if None).

    Raises:
        UnknownNameError: there is no layout or style of that id, or the layout names an unknown fixture type.
    """
    style = load_style(layout_id if style_id is None else style_id)
    return furnish(layout_id, layout_record(layout_id), style)


def furnish(layout_id: int, record: dict[str, Any], style: Style) -> Layout:
    """Lay out the fixtures of a layout file's content."""
    size = record["room"]
    room = {"x_min": 0.0, "x_max": size["width"], "y_min": -size["depth"], "height": size["height"]}
    names = Names()
    rows: dict[str, Row] = {}
    for wall in WALLS:
        line = wall_line(wall, size["width"], size["depth"])
        rows[wall] = row = Row(line, style, names)
        plan = record.get(wall, {})
        if "base" in plan:
            base_row(row, plan["base"], plan.get("start", 0.0))
        if "upper" in plan:
            upper_row(row, plan["upper"], plan.get("upper_start", plan.get("start", 0.0)), room["height"])
        add_splash(row, plan)
        counter_items(row, plan.get("counter", []))
    made = list(rows.values())
    for kind, add in (("island", add_island), ("peninsula", add_island), ("table", add_table)):
        if kind in record:
            made.append(add(record[kind], kind, style, names, room["height"]))
    shell = Row(Line(0.0, 0.0, 0.0), style, names)
    add_room(shell, record, rows, room)
    layout = Layout(layout_id, style.style_id, record["name"], record["plan"], room)
    for row in (shell, *made):
        for fixture in row.fixtures:
            assert fixture.name not in layout.fixtures, fixture.name
            layout.fixtures[fixture.name] = fixture
            layout.types[fixture.name] = row.types[fixture.name]
    return layout


def wall_line(wall: str, width: float, depth: float) -> Line:
    """Where the row along a wall runs: from left to right for someone who faces the wall."""
    quarter = float(np.pi / 2)
    return {
        "back": Line(0.0, 0.0, 0.0),
        "left": Line(0.0, -depth, quarter),
        "right": Line(width, 0.0, -quarter),
        "front": Line(width, -depth, 2 * quarter),
    }[wall]
