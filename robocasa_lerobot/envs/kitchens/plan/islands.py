"""Islands, peninsulas and dining tables, with their stools and lamps."""

from __future__ import annotations

from typing import Any

import numpy as np

from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Panel
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.room import CeilingLamp
from robocasa_lerobot.envs.kitchens.fixtures.stools import SEAT_M, STOOL_HEIGHT_M, Stool
from robocasa_lerobot.envs.kitchens.materials import Style
from robocasa_lerobot.envs.kitchens.plan.fixture_rows import (
    BASE_HEIGHT,
    COUNTER_DEPTH,
    COUNTER_HEIGHT,
    COUNTER_THICKNESS,
    Line,
    Names,
    Row,
    base_row,
    counter_items,
    total_width,
)

# In which direction the doors of an island face, and the yaw of its fixtures.
FACING = {"front": 0.0, "right": np.pi / 2, "back": np.pi, "left": -np.pi / 2}
STOOL_OUT_M = 0.12  # of a stool's middle from the counter's edge
PENDANT_Z_M = 1.95
_BACK_PANEL_M = 0.02
_LEGS_M = 0.14  # at either end of a table, where its legs are


def island_line(record: dict[str, Any]) -> Line:
    """Where the row of an island's fixtures runs: along the backs of its cabinets."""
    length, yaw = total_width(record["base"]), float(FACING[record["facing"]])
    x, y = record["at"]
    depth = COUNTER_DEPTH + record.get("overhang", 0.0)
    # From the middle of the counter: half its length to the left, and to the backs of the cabinets.
    local = np.array([-length / 2, depth / 2 - record.get("overhang", 0.0)])
    c, s = np.cos(yaw), np.sin(yaw)
    return Line(round(float(x + c * local[0] - s * local[1]), 6), round(float(y + s * local[0] + c * local[1]), 6), yaw)


def add_island(record: dict[str, Any], kind: str, style: Style, names: Names, ceiling: float) -> Row:
    """An island or a peninsula: a row of base fixtures under a counter whose far side overhangs for seats."""
    prefix = "island_" if kind == "island" else "dining_peninsula_"
    line = island_line(record)
    row = Row(line, style, names, prefix=prefix, surfaces=("island", "counter_island"))
    overhang = record.get("overhang", 0.0)
    base_row(row, record["base"], 0.0)
    length = total_width(record["base"])
    counter = next(f for f in row.fixtures if isinstance(f, Counter))
    row.fixtures.remove(counter)
    del row.types[counter.name]
    counter.name = prefix + "counter"
    counter.island_only = kind == "island" and not record.get("stools")
    counter.overhang, counter.back_face = overhang, True
    if overhang:
        pos = line.at(length / 2, (COUNTER_DEPTH - overhang) / 2, COUNTER_HEIGHT - COUNTER_THICKNESS / 2)
        shift = overhang / 2  # of the counter's middle away from its front
        if counter.opening is not None:
            x0, x1, y0, y1 = counter.opening
            counter.opening = (x0, x1, y0 - shift, y1 - shift)
        counter.size, counter.pos = (length, COUNTER_DEPTH + overhang, COUNTER_THICKNESS), pos
    row.add("counter", counter)
    back = (length, _BACK_PANEL_M, BASE_HEIGHT)
    pos = line.at(length / 2, -_BACK_PANEL_M / 2, BASE_HEIGHT / 2)
    turned = line.yaw + np.pi
    row.add("panel_cabinet", Panel(f"{prefix}back", back, pos, turned, surface="island", plain=False))
    _stools(row, names, record.get("stools", 0), length, -overhang - STOOL_OUT_M, turned)
    _pendants(row, names, record.get("pendants", 0), length, (COUNTER_DEPTH - overhang) / 2, ceiling)
    counter_items(row, record.get("counter", []))
    return row


def add_table(record: dict[str, Any], kind: str, style: Style, names: Names, ceiling: float) -> Row:
    """A dining table of counter height with stools along its sides; `kind` is not needed."""
    del kind
    x, y = record["at"]
    width, depth = record["size"]
    yaw = float(FACING[record.get("facing", "front")])
    c, s = np.cos(yaw), np.sin(yaw)
    line = Line(float(x - c * width / 2 - s * depth / 2), float(y - s * width / 2 + c * depth / 2), yaw)
    row = Row(line, style, names, prefix="dining_table_", surfaces=("island", "table_top"))
    pos = (x, y, COUNTER_HEIGHT - COUNTER_THICKNESS / 2)
    table = Counter("dining_table", (width, depth, COUNTER_THICKNESS), pos, yaw, surface="table_top")
    table.table = table.back_face = True
    table.overhang = depth
    row.add("counter", table)
    _stools(row, names, record.get("stools", 0), width, -STOOL_OUT_M, yaw + np.pi, _LEGS_M)
    _stools(row, names, record.get("front_stools", 0), width, depth + STOOL_OUT_M, yaw, _LEGS_M)
    _pendants(row, names, record.get("pendants", 0), width, depth / 2, ceiling)
    counter_items(row, record.get("counter", []))
    return row


def _stools(row: Row, names: Names, count: int, length: float, out: float, yaw: float, inset: float = 0.0) -> None:
    """Stools in a line, at equal distances along the counter but its ends; their fronts look at it."""
    for index in range(count):
        along = inset + (index + 0.5) * (length - 2 * inset) / count
        size = (SEAT_M, SEAT_M, STOOL_HEIGHT_M)
        pos = row.line.at(along, out, STOOL_HEIGHT_M / 2)
        row.add("stool", Stool(names.next("stool"), size, pos, float(yaw + np.pi)))


def _pendants(row: Row, names: Names, count: int, length: float, out: float, ceiling: float) -> None:
    for index in range(count):
        size = (0.24, 0.24, 0.22)
        pos = row.line.at((index + 0.5) * length / count, out, PENDANT_Z_M)
        cord = ceiling - PENDANT_Z_M - size[2] / 2
        row.add("accessory", CeilingLamp(names.next("pendant"), size, pos, cord=cord))
