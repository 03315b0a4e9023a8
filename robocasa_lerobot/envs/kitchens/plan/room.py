"""The shell of a kitchen from its layout file: floor, walls with the openings of windows, ceiling, lamps, doors."""

from __future__ import annotations

from typing import Any

from robocasa_lerobot.envs.kitchens.fixtures.accessories import SIZES, WALL_KINDS, make_accessory
from robocasa_lerobot.envs.kitchens.fixtures.room import CeilingLamp, Doorway, Slab, Wall, Window
from robocasa_lerobot.envs.kitchens.plan.fixture_rows import (
    WALL_THICKNESS,
    WINDOW_BOTTOM,
    WINDOW_TOP,
    Row,
    base_types,
    entry_kind,
)

_DOOR = (0.95, 0.06, 2.10)
_LAMP_SPACING_M = 1.9


def add_room(shell: Row, record: dict[str, Any], rows: dict[str, Row], room: dict[str, float]) -> None:
    """Add floor, ceiling, walls, and what hangs on the walls away from the rows."""
    x1, y0, height = room["x_max"], room["y_min"], room["height"]
    middle = (x1 / 2, y0 / 2)
    shell.add("floor", Slab("floor", (x1, -y0, 0.1), (*middle, -0.05), surface="floor"))
    outer = (x1 + 2 * WALL_THICKNESS, -y0 + 2 * WALL_THICKNESS, 0.05)
    shell.add("box", Slab("ceiling", outer, (*middle, height + 0.025), surface="ceiling"))
    for wall, row in rows.items():
        length = x1 if wall in ("back", "front") else -y0
        plan = record.get(wall, {})
        for kind in ("windows", "doors", "hangings"):
            _hang(row, kind, plan.get(kind, []))
        half = length / 2
        openings = tuple(
            (a - half + 0.08, b - half - 0.08, WINDOW_BOTTOM - height / 2, WINDOW_TOP - height / 2)
            for a, b in row.windows
        )
        free = tuple((a - half, b - half) for a, b in _free(plan, length))
        # Walls meet outside the room: each is longer by the thickness of its neighbours on one side.
        pos = row.line.at(half, -WALL_THICKNESS / 2, height / 2)
        size = (length, WALL_THICKNESS, height)
        shell.add("wall", Wall(f"wall_{wall}", size, pos, row.line.yaw, openings=openings, skirting=free))
    _lamps(shell, room)


def _hang(row: Row, kind: str, entries: list[dict[str, Any]]) -> None:
    line, yaw = row.line, row.line.yaw
    for entry in entries:
        what, along = next(iter(entry.items()))
        if kind == "doors":
            width, depth, height = _DOOR
            pos = line.at(along, depth / 2, height / 2)
            row.add("wall_accessory", Doorway(row.name("door"), _DOOR, pos, yaw))
        elif kind == "windows":
            width = float(entry.get("width", 1.2))
            row.windows.append((along - width / 2, along + width / 2))
            size = (width - 0.16, WALL_THICKNESS, WINDOW_TOP - WINDOW_BOTTOM)
            pos = line.at(along, -WALL_THICKNESS / 2, (WINDOW_TOP + WINDOW_BOTTOM) / 2)
            window = Window(row.name("window"), size, pos, yaw, columns=max(1, round(size[0] / 0.5)))
            row.add("window", window)
        else:
            assert what in WALL_KINDS, what
            depth, tall = SIZES[what][1:]
            pos = line.at(along, depth / 2 + 0.001, float(entry.get("z", 1.6)) - tall / 2)
            row.add(what, make_accessory(what, row.name(what), pos, yaw))


def _free(plan: dict[str, Any], length: float) -> list[tuple[float, float]]:
    """Parts of a wall that nothing of its row stands at, and no door is in."""
    taken: list[tuple[float, float]] = []
    along = float(plan.get("start", 0.0))
    for entry in plan.get("base", []):
        kind, width = entry_kind(entry, base_types())
        if kind != "gap":
            taken.append((along, along + width))
        along += width
    taken += [(d["door"] - _DOOR[0] / 2, d["door"] + _DOOR[0] / 2) for d in plan.get("doors", [])]
    free, at = [], 0.0
    for a, b in [*sorted(taken), (length, length)]:
        if a - at > 0.02:
            free.append((at, a))
        at = max(at, b)
    return free


def _lamps(shell: Row, room: dict[str, float]) -> None:
    """Flat lamps under the ceiling, in a grid over the room."""
    counts = [max(1, round(side / _LAMP_SPACING_M)) for side in (room["x_max"], -room["y_min"])]
    for i in range(counts[0]):
        for j in range(counts[1]):
            x, y = room["x_max"] * (i + 0.5) / counts[0], room["y_min"] * (j + 0.5) / counts[1]
            pos = (round(float(x), 4), round(float(y), 4), room["height"] - 0.011)
            shell.add("accessory", CeilingLamp(shell.name("lamp"), (0.20, 0.20, 0.02), pos))
