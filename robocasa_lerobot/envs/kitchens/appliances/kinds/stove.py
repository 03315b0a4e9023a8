"""Stoves: burners that knobs turn on, flames or glowing rings that follow them, and, below, an oven."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Standing, Touches
from robocasa_lerobot.envs.kitchens.appliances.kinds.oven import DOOR_M, add_oven_door
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region

# Angles of a knob, radians (docs/robocasa.md, section 7).
ON_FROM, HIGH_FROM = 0.35, float(np.radians(80.0))
KNOB_MAX = 1.5 * np.pi

_PANEL_M, _KICK_M, _HOB_M = 0.115, 0.08, 0.014
_GRATE_M = 0.036  # top of the grates above the hob
_SURFACE_M = {"gas": _GRATE_M, "coil": 0.010}  # what pans stand on, above the hob; else its plate
_GRATE_REACH = 1.18  # length of a grate's bars from its middle, in radii of its burner
_PAN_REACH_M, _PAN_ROOM_M = 0.11, 0.10  # half sizes of the room of a pan on a burner
_LEVELS = {"off": 0.0, "low": 0.62, "high": 1.0}  # how far a flame or ring is shown

FOUR = {
    "front_left": (-0.25, -0.22),
    "rear_left": (-0.25, 0.20),
    "rear_right": (0.25, 0.20),
    "front_right": (0.25, -0.22),
}
FIVE = {**FOUR, "center": (0.0, -0.01)}
SIX = {
    "front_left": (-0.31, -0.22),
    "rear_left": (-0.31, 0.20),
    "front_center": (0.0, -0.22),
    "rear_center": (0.0, 0.20),
    "rear_right": (0.31, 0.20),
    "front_right": (0.31, -0.22),
}


@dataclass
class Hob(Appliance):
    """What stove and stovetop share: burners, by location, each with a knob `knob_<location>`."""

    @property
    def burners(self) -> dict[str, tuple[float, float]]:
        """Middle of each burner by location, as shares of width and depth."""
        return FOUR

    def parts_to_choose(self, name: str) -> dict[str, dict[str, str]]:
        """Its burners."""
        return {location: {name: location.replace("_", " ")} for location in self.burners}

    @property
    def regions(self) -> dict[str, Region]:
        """Above each burner, by its location: where the bottom of a pan stands."""
        width, depth, height = self.size
        z = height / 2 + _SURFACE_M.get(self.record["hob"], 0.001)
        return {
            location: Region(
                self.name, (x * width, y * depth, z + _PAN_ROOM_M), (_PAN_REACH_M, _PAN_REACH_M, _PAN_ROOM_M)
            )
            for location, (x, y) in self.burners.items()
        }

    def bears(self, x: float, y: float) -> bool:
        """A grate has four bars crosswise: a pan tips over that has its weight beside what they reach round."""
        if self.record["hob"] != "gas":
            return True
        width, depth, _ = self.size
        return any(
            abs(x - at_x * width) + abs(y - at_y * depth) <= _GRATE_REACH * self._radius(location)
            for location, (at_x, at_y) in self.burners.items()
        )

    def _radius(self, location: str) -> float:
        """Of a burner, metres."""
        width, depth, _ = self.size
        radius = 0.092 if location in ("front_right", "center", "rear_left") else 0.080
        return min(radius, 0.135 * width, 0.17 * depth)

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of doors; by burner the knob's angle in radians and whether it is on (`<location>_on`)."""
        state = super().state(data)
        for location in self.burners:
            state[f"knob_{location}"] = self.knob_angle(data, location)
            state[f"{location}_on"] = self.burner_level(data, location) != "off"
        return state

    def knob_angle(self, data: mujoco.MjData, location: str) -> float:
        """Angle of a knob in [0, 2 pi)."""
        return float(self.position(data, f"knob_{location}") % (2 * np.pi))

    def burner_level(self, data: mujoco.MjData, location: str) -> str:
        """Which of "off", "low" or "high" a burner's knob asks for."""
        angle = self.knob_angle(data, location)
        if not ON_FROM <= angle <= 2 * np.pi - ON_FROM:
            return "off"
        return "low" if angle < HIGH_FROM else "high"

    def set_burner(self, data: mujoco.MjData, location: str, level: str, draw: float = 0.5) -> None:
        """Turn a burner "off", or "on", "low" or "high" at a share `draw` of that range; for initial states."""
        low, high = {
            "off": (0.0, 0.0),
            "on": (0.5, KNOB_MAX),
            "low": (ON_FROM, HIGH_FROM),
            "high": (HIGH_FROM, KNOB_MAX),
        }[level]
        # Just inside, since the upper end of "low" is already "high".
        self.set_position(data, f"knob_{location}", low + min(draw, 0.999) * (high - low))

    def nearest_burner(self, data: mujoco.MjData, point: NDArray[np.float64]) -> tuple[str, float]:
        """The burner nearest to a world point, and its horizontal distance, metres."""
        reach = {
            location: float(np.linalg.norm(data.site(f"{self.name}_burner_on_{location}").xpos[:2] - point[:2]))
            for location in self.burners
        }
        nearest = min(reach, key=lambda location: reach[location])
        return nearest, reach[nearest]

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Flames and rings follow the knobs."""
        for location in self.burners:
            self.show(data, f"burner_{location}", _LEVELS[self.burner_level(data, location)])

    def add_burners(self, parts: Parts, root: mujoco.MjsBody, top: float) -> None:
        """Burners, grates and their glow when they are on, over a hob whose surface is at `top`."""
        width, depth, _ = self.size
        kind = self.record["hob"]
        for location, (share_x, share_y) in self.burners.items():
            x, y = share_x * width, share_y * depth
            radius = self._radius(location)
            lamp = parts.lamp(root, f"burner_{location}", (x, y, top - 0.03), (x, y, top))
            if kind == "gas":
                parts.tube(root, (x, y, top + 0.006), radius * 0.62, 0.012, "steel_plain", bevel=0.003, collide=False)
                parts.tube(root, (x, y, top + 0.016), radius * 0.48, 0.010, "iron", bevel=0.003, collide=False)
                parts.mesh(lamp, meshes.crown(radius * 0.60, 0.026), (0, 0, 0.004), "flame")
                self._add_grate(parts, root, (x, y, top), radius)
                site_z = top + _GRATE_M
            elif kind == "coil":
                parts.tube(root, (x, y, top + 0.002), radius * 1.12, 0.004, "chrome", collide=False)
                parts.tube(root, (x, y, top + 0.006), radius, 0.008, "iron")
                for number, share in enumerate((0.86, 0.72, 0.52, 0.38)):
                    colour = ("chrome", "iron")[number % 2]
                    spot = (x, y, top + 0.0102 + 0.0002 * number)
                    parts.mesh(root, meshes.disc(radius * share), spot, colour)
                for number, share in enumerate((1.0, 0.86, 0.72, 0.52, 0.38)):
                    colour = ("light_orange", "light_red")[number % 2]
                    parts.mesh(lamp, meshes.disc(radius * share), (0, 0, 0.0112 + 0.0002 * number), colour)
                site_z = top + 0.010
            else:
                parts.mesh(root, meshes.disc(radius, 20), (x, y, top + 0.0003), "label")
                parts.mesh(root, meshes.disc(radius * 0.96, 20), (x, y, top + 0.0006), "dark_glass")
                parts.mesh(lamp, meshes.disc(radius * 0.95, 20), (0, 0, 0.0010), "light_red")
                parts.mesh(lamp, meshes.disc(radius * 0.60, 14), (0, 0, 0.0013), "light_orange")
                site_z = top + 0.001
            parts.site(root, f"burner_on_{location}", (x, y, site_z))

    def _add_grate(self, parts: Parts, root: mujoco.MjsBody, middle: tuple[float, float, float], radius: float) -> None:
        x, y, top = middle
        reach, bar = radius * _GRATE_REACH, 0.010
        z = top + _GRATE_M - bar / 2
        for dx, dy in ((1, 0), (0, 1)):
            for sign in (-1, 1):
                # Bars end short of the middle, where flame and cap are seen.
                along = (reach + radius * 0.25) / 2 * sign
                size = (reach - radius * 0.25 if dx else bar, reach - radius * 0.25 if dy else bar, bar)
                parts.box(root, (x + dx * along, y + dy * along, z), size, "iron")
                foot = (x + dx * sign * reach, y + dy * sign * reach, top + _GRATE_M / 2)
                parts.box(root, foot, (bar, bar, _GRATE_M), "iron")


@dataclass
class Stove(Hob):
    """A range: a hob, knobs on the front, an oven with a door and a rack below."""

    standing: ClassVar[Standing] = Standing("floor", name="stove", tiled=True)
    looks: ClassVar = {
        "off": {},
        "on": {"knob_front_left": 0.6, "burner_front_left": 1.0, "knob_rear_right": 0.2, "burner_rear_right": 0.62},
        "open": {"door": 1.0},
    }

    @property
    def doors(self) -> tuple[str, ...]:
        """The oven's door."""
        return ("door",)

    @property
    def burners(self) -> dict[str, tuple[float, float]]:
        """Six on a wide stove, five on electric ones with room for them, else four."""
        if self.record.kind == "stove_wide":
            return SIX
        return FIVE if self.record["hob"] == "gas" and self.record["back"] == 0.0 else FOUR

    @property
    def regions(self) -> dict[str, Region]:
        """Above each burner, by its location, then the oven above its rack."""
        low, high = self._cavity()
        low[2] += 0.10
        return {**super().regions, "interior": Region.between(self.name, low, high)}

    def _cavity(self) -> tuple[np.ndarray, np.ndarray]:
        width, depth, height = self.size
        low = np.array([-width / 2 + 0.05, -depth / 2 + DOOR_M, -height / 2 + 0.23])
        high = np.array([width / 2 - 0.05, depth / 2 - 0.06, height / 2 - _PANEL_M - 0.05])
        return low, high

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add case, hob, burners, knobs, oven door and storage drawer."""
        width, depth, height = self.size
        finish = self.record["finish"]
        front, top = -depth / 2, height / 2
        low, high = self._cavity()
        case_low = (-width / 2, front + DOOR_M, -height / 2 + _KICK_M)
        walls = {
            "left": 0.05,
            "right": 0.05,
            "bottom": float(low[2] - case_low[2]),
            "top": float(top - _HOB_M - high[2]),
            "back": 0.06,
            "front": 0.0,
        }
        parts.shell(root, case_low, (width / 2, depth / 2, top - _HOB_M), walls, _side(finish), "enamel")
        kick = ((-width / 2 + 0.02, front + 0.07, -height / 2), (width / 2 - 0.02, depth / 2, -height / 2 + _KICK_M))
        parts.span(root, *kick, "black")
        size = (high[0] - low[0] - 0.01, high[1] - low[1] - 0.03, 0.005)
        rack = root.add_body(pos=[0, float(low[1] + high[1]) / 2, float(low[2]) + 0.10])
        parts.wire_rack(rack, size, "wire", bars=8, name="rack")
        hob = "dark_glass" if self.record["hob"] == "glass" else ("black" if finish == "black" else finish)
        parts.span(root, (-width / 2, front, top - _HOB_M), (width / 2, depth / 2, top), hob, name="hob")
        back = self.record["back"]
        if back > 0:
            guard = ((-width / 2, depth / 2 - 0.035, top), (width / 2, depth / 2, top + back))
            parts.span(root, *guard, finish)
        self.add_burners(parts, root, top)
        panel = ((-width / 2, front, top - _HOB_M - _PANEL_M), (width / 2, front + DOOR_M, top - _HOB_M))
        parts.span(root, *panel, finish)
        self._add_knobs(parts, root)
        drawer_top = -height / 2 + 0.215
        add_oven_door(parts, root, self.size, (drawer_top + 0.006, top - _HOB_M - _PANEL_M - 0.006), self.record)
        drawer = (
            (-width / 2 + 0.004, front, -height / 2 + _KICK_M + 0.004),
            (width / 2 - 0.004, front + DOOR_M, drawer_top),
        )
        parts.span(root, *drawer, finish)

    def _add_knobs(self, parts: Parts, root: mujoco.MjsBody) -> None:
        width, depth, height = self.size
        order = sorted(self.burners, key=lambda location: (self.burners[location][0], self.burners[location][1]))
        dark = self.record["finish"] in ("black", "black_steel", "graphite", "navy")
        body, pointer = ("silver", "black") if dark else ("black", "white")
        z = height / 2 - _HOB_M - _PANEL_M / 2
        pitch = width * 0.86 / len(order)
        for index, location in enumerate(order):
            x = (index - (len(order) - 1) / 2) * pitch
            parts.tube(root, (x, -depth / 2 - 0.001, z), 0.030, 0.003, "chrome", axis="y", collide=False)
            parts.knob(
                root, f"knob_{location}", (x, -depth / 2 - 0.002, z), 0.0225, body, pointer, limits=(0.0, KNOB_MAX),
                length=0.030, style=self.record["knob"],
            )  # fmt: skip


@dataclass
class Stovetop(Hob):
    """A hob with knobs on top; its box is the plate that stands out of the counter."""

    standing: ClassVar[Standing] = Standing("built_in")
    looks: ClassVar = {
        "off": {},
        "on": {"knob_front_left": 0.6, "burner_front_left": 1.0, "knob_rear_right": 0.2, "burner_rear_right": 0.62},
    }

    @property
    def burners(self) -> dict[str, tuple[float, float]]:
        """Four, or five with one in the middle; moved to the left of the knobs."""
        burners = FIVE if self.record["burners"] == 5 else FOUR
        return {location: (x * 1.08 - 0.075, y * 1.05 + 0.01) for location, (x, y) in burners.items()}

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add the plate, burners and knobs."""
        width, depth, height = self.size
        top = height / 2
        finish = "dark_glass" if self.record["hob"] == "glass" else self.record["finish"]
        parts.span(root, (-width / 2, -depth / 2, -top), (width / 2, depth / 2, top), finish, name="hob")
        if self.record["hob"] == "glass":
            for side in (-1, 1):
                parts.box(
                    root, (0, side * (depth / 2 - 0.003), top), (width, 0.006, 0.003), self.record["finish"],
                    collide=False,
                )  # fmt: skip
        self.add_burners(parts, root, top)
        order = sorted(self.burners, key=lambda location: (self.burners[location][1], self.burners[location][0]))
        light = finish in ("dark_glass", "black", "black_steel")
        body, pointer = ("silver", "black") if light else ("black", "white")
        pitch = min(0.085, depth * 0.82 / len(order))
        for index, location in enumerate(order):
            y = (index - (len(order) - 1) / 2) * pitch
            x = width / 2 - 0.045
            parts.tube(root, (x, y, top + 0.001), 0.026, 0.002, "chrome", collide=False)
            parts.knob(
                root, f"knob_{location}", (x, y, top + 0.002), 0.0205, body, pointer, limits=(0.0, KNOB_MAX),
                length=0.026, facing="top", style=self.record["knob"],
            )  # fmt: skip


def _side(finish: str) -> str:
    """Sides are painted where the front is steel."""
    return {"steel": "graphite", "warm_steel": "graphite", "black_steel": "black"}.get(finish, finish)
