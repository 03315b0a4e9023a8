"""Dishwashers: a door that folds down, two racks that slide out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Standing
from robocasa_lerobot.envs.kitchens.appliances.kinds.racked import Racked, fold_door
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region, SweptBox
from robocasa_lerobot.envs.kitchens.fixtures.swept import folded_down

DOOR_M, _KICK_M, _WALL_M = 0.050, 0.15, 0.022
OPEN_RAD = 1.30  # how far the door folds down: lower than 0.30 m the gripper hardly comes, and the edge lies at 0.34 m
_RIM_M = {"rack0": 0.12, "rack1": 0.07}


@dataclass
class Dishwasher(Racked):
    """Racks `rack0` (lower) and `rack1` (upper)."""

    standing: ClassVar[Standing] = Standing("under_counter")
    looks: ClassVar = {"closed": {}, "open": {"door": 1.0, "rack0": 0.8, "rack1": 0.4}}

    def swept_areas(self) -> tuple[SweptBox, ...]:
        """Its open door."""
        return folded_down(self, self.door_span)

    @property
    def door_span(self) -> tuple[float, float]:
        """Lower and upper edge of the door in the fixture's frame, metres."""
        return -self.height / 2 + _KICK_M, self.height / 2 - 0.006

    @property
    def regions(self) -> dict[str, Region]:
        """Above each rack, the upper one first, moving with it; then the whole inside."""
        low, high = self.cavity()
        size = self._rack_size()
        levels = dict(zip(self.racks, self.rack_heights(), strict=True))
        tops = {"rack0": levels["rack1"] - 0.02, "rack1": float(high[2]) - 0.01}
        found = {}
        for rack in reversed(self.racks):
            room = (tops[rack] - levels[rack]) / 2
            found[rack] = Region(f"{self.name}_{rack}", (0, 0, room), (size[0] / 2 - 0.012, size[1] / 2 - 0.012, room))
        found["interior"] = Region.between(self.name, low, high)
        return found

    def cavity(self) -> tuple[np.ndarray, np.ndarray]:
        """Opposite corners of its inside in its frame, metres, each (3,)."""
        width, depth, height = self.size
        low = np.array([-width / 2 + _WALL_M, -depth / 2 + DOOR_M, -height / 2 + _KICK_M + 0.03])
        high = np.array([width / 2 - _WALL_M, depth / 2 - 0.04, height / 2 - 0.03])
        return low, high

    def rack_levels(self) -> tuple[float, ...]:
        """Height of each rack from below, as a share of the cavity's."""
        return (0.18, 0.60)

    def _rack_size(self) -> np.ndarray:
        low, high = self.cavity()
        return np.array([high[0] - low[0] - 0.02, high[1] - low[1] - 0.02, 0.005])

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add case, racks, door and controls."""
        width, depth, height = self.size
        front = -depth / 2
        finish = self.record["finish"]
        kick = ((-width / 2, front + 0.07, -height / 2), (width / 2, depth / 2, -height / 2 + _KICK_M))
        parts.span(root, *kick, "black")
        case = ((-width / 2, front + DOOR_M, -height / 2 + _KICK_M), (width / 2, depth / 2, height / 2))
        walls = {"left": _WALL_M, "right": _WALL_M, "bottom": 0.03, "top": 0.03, "back": 0.04, "front": 0.0}
        parts.shell(root, *case, walls, "graphite", "steel_plain")
        for rack in self.racks:
            self._add_rack(parts, root, rack)
        door_h = self.door_span[1] - self.door_span[0]
        door = fold_door(
            parts,
            root,
            (0, front + DOOR_M, -height / 2 + _KICK_M),
            (width, DOOR_M, door_h),
            mass=1.6,
            weight_at=(0.010, 0.4),
            friction=6.0,
            damping=2.0,
            limit=OPEN_RAD,
        )
        strip = 0.085 if self.record["family"] == "front_control" else 0.0
        parts.box(
            door, (0, -DOOR_M / 2, (door_h - strip) / 2), (width - 0.006, DOOR_M - 0.002, door_h - strip), finish,
            name="front",
        )  # fmt: skip
        parts.box(door, (0, -0.002, door_h / 2), (width - 0.06, 0.005, door_h - 0.05), "steel_plain", collide=False)
        parts.box(door, (0.08, 0.004, door_h * 0.42), (0.16, 0.012, 0.10), "graphite", collide=False)
        if strip > 0:
            z = door_h - strip / 2
            colour = finish if finish in ("white", "black") else "black"
            parts.box(door, (0, -DOOR_M / 2, z), (width - 0.006, DOOR_M - 0.002, strip - 0.002), colour)
            y = -DOOR_M + 0.0005
            if self.record["panel"] == "display":
                parts.box(door, (0, y, z), (0.09, 0.003, 0.032), "screen", collide=False)
            else:
                parts.tube(door, (-width * 0.36, y - 0.006, z), 0.024, 0.016, "silver", axis="y", bevel=0.003)
            for index in range(4):
                parts.box(door, (width * (0.18 + 0.07 * index), y, z), (0.02, 0.004, 0.012), "silver", collide=False)
        handle_z = door_h - strip - 0.055
        parts.handle(
            door, (0, -DOOR_M, handle_z), width * 0.74, "steel_plain", axis="x", name="handle",
            style=self.record["handle"],
        )  # fmt: skip

    def _add_rack(self, parts: Parts, root: mujoco.MjsBody, rack: str) -> None:
        size, rim = self._rack_size(), _RIM_M[rack]
        body = self.add_rack(parts, root, rack, size, mass=1.2, reach=0.80, bars=7, height=0.08, rim=rim)
        # The front rail carries a grip that a finger gets behind.
        parts.box(body, (0, -size[1] / 2 - 0.004, rim), (0.16, 0.012, 0.030), "graphite")
        rows = int(self.record["tines"])
        for x in np.linspace(-0.34, 0.34, rows):
            for y in (-0.28, 0.05, 0.34):
                parts.box(body, (float(x) * size[0], y * size[1], 0.022), (0.004, 0.004, 0.044), "wire", collide=False)
