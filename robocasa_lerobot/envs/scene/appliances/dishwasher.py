"""Dishwashers: a door that folds down, two racks that slide out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.scene.appliances.base import Appliance
from robocasa_lerobot.envs.scene.appliances.parts import Parts
from robocasa_lerobot.envs.scene.fixtures.base import Region

DOOR_M, _KICK_M, _WALL_M = 0.050, 0.10, 0.022
_RACKS = {"rack0": 0.10, "rack1": 0.56}  # level of each as a share of the inside
_RIM_M = {"rack0": 0.12, "rack1": 0.07}


@dataclass
class Dishwasher(Appliance):
    """Racks `rack0` (lower) and `rack1` (upper)."""

    looks: ClassVar = {"closed": {}, "open": {"door": 1.0, "rack0": 0.8, "rack1": 0.4}}

    @property
    def doors(self) -> tuple[str, ...]:
        """The door."""
        return ("door",)

    @property
    def racks(self) -> tuple[str, ...]:
        """Racks from below."""
        return tuple(_RACKS)

    @property
    def regions(self) -> dict[str, Region]:
        """Above each rack, the upper one first, moving with it; then the whole inside."""
        low, high = self._inside()
        size = self._rack_size()
        levels = {rack: float(low[2] + share * (high[2] - low[2])) for rack, share in _RACKS.items()}
        tops = {"rack0": levels["rack1"] - 0.02, "rack1": float(high[2]) - 0.01}
        found = {}
        for rack in reversed(_RACKS):
            room = (tops[rack] - levels[rack]) / 2
            found[rack] = Region(f"{self.name}_{rack}", (0, 0, room), (size[0] / 2 - 0.012, size[1] / 2 - 0.012, room))
        found["interior"] = Region.between(self.name, low, high)
        return found

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of the ranges of door and racks."""
        return {part: self.share(data, part) for part in (*self.doors, *self.racks)}

    def _inside(self) -> tuple[np.ndarray, np.ndarray]:
        width, depth, height = self.size
        low = np.array([-width / 2 + _WALL_M, -depth / 2 + DOOR_M, -height / 2 + _KICK_M + 0.03])
        high = np.array([width / 2 - _WALL_M, depth / 2 - 0.04, height / 2 - 0.03])
        return low, high

    def _rack_size(self) -> np.ndarray:
        low, high = self._inside()
        return np.array([high[0] - low[0] - 0.02, high[1] - low[1] - 0.02, 0.005])

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add case, racks, door and controls."""
        width, depth, height = self.size
        front = -depth / 2
        finish = self.record["finish"]
        kick = ((-width / 2, front + 0.07, -height / 2), (width / 2, depth / 2, -height / 2 + _KICK_M))
        parts.span(root, *kick, "black")
        low, high = self._inside()
        case = ((-width / 2, front + DOOR_M, -height / 2 + _KICK_M), (width / 2, depth / 2, height / 2))
        walls = {"left": _WALL_M, "right": _WALL_M, "bottom": 0.03, "top": 0.03, "back": 0.04, "front": 0.0}
        parts.shell(root, *case, walls, "graphite", "steel_plain")
        for rack, share in _RACKS.items():
            self._add_rack(parts, root, rack, float(low[2] + share * (high[2] - low[2])))
        door_h = height - _KICK_M - 0.006
        door = parts.hinge(
            root,
            "door",
            (0, front + DOOR_M, -height / 2 + _KICK_M),
            (1, 0, 0),
            (0.0, np.pi / 2),
            mass=1.6,
            size=(width, DOOR_M, door_h),
            center=(0, 0.010, door_h * 0.4),  # weighed so that it stays shut
            friction=6.0,
            damping=2.0,
            armature=0.05,
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

    def _add_rack(self, parts: Parts, root: mujoco.MjsBody, rack: str, level: float) -> None:
        low, high = self._inside()
        size = self._rack_size()
        body = parts.slide(
            root,
            rack,
            (0, (low[1] + high[1]) / 2, level),
            (0, -1, 0),
            (0.0, 0.80 * float(size[1])),
            mass=1.2,
            size=(size[0], size[1], 0.08),
            friction=1.5,
            damping=8.0,
        )
        rim = _RIM_M[rack]
        parts.wire_rack(body, size, "wire", bars=7, rim=rim, name=rack)
        # The front rail carries a grip that a finger gets behind.
        parts.box(body, (0, -size[1] / 2 - 0.004, rim), (0.16, 0.012, 0.030), "graphite")
        rows = int(self.record["tines"])
        for x in np.linspace(-0.34, 0.34, rows):
            for y in (-0.28, 0.05, 0.34):
                parts.box(body, (float(x) * size[0], y * size[1], 0.022), (0.004, 0.004, 0.044), "wire", collide=False)
