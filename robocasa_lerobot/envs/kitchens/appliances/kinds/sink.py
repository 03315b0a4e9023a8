"""Sinks: one or two basins let into the counter, a faucet whose spout swings, a lever for water and temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Standing, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import HIDDEN_M, Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region

# docs/robocasa.md, section 7: angles in radians, shares of ranges.
WATER_FROM, WATER_TO = 0.40, np.pi
HIGH_FROM, HOT_FROM = 0.5, 0.5
SIDE_FROM = np.pi / 6
SET_ON = (0.40, 0.50)  # a faucet that starts on

HANDLE_MAX, TEMP_MAX, SPOUT_MAX = 1.2, 1.6, 1.2
TEMP_START = 0.4  # share of the temperature when nobody has set it: cold, but not by a hair
WALL_M, RIM_M = 0.012, 0.020
_FAUCET_BACK_M = 0.055  # from the basin's rear edge
# What foot, bridge and levers of a faucet cover of the counter: to the left and right of its middle, half the depth.
_FAUCET_SIDES_M, _FAUCET_HALF_DEPTH_M = (-0.13, 0.19), 0.045
_STREAMS = ("cold_low", "cold_high", "hot_low", "hot_high")


@dataclass
class Sink(Appliance):
    """Its box is the basin's, the top edge flush with the counter's top; the faucet stands behind it.

    Parts `handle` (water), `handle_temp` (0 cold, 1 hot) and `spout` (positive to the right).
    """

    standing: ClassVar[Standing] = Standing("built_in")
    holds_all_of_it: ClassVar[bool] = True
    looks: ClassVar = {
        "off": {},
        "on": {"handle": 0.45, "handle_temp": 0.2, "water_cold_low": 1.0},
        "hot, right": {"handle": 0.8, "handle_temp": 0.8, "spout": 0.2, "water_hot_high": 1.0},
    }

    @property
    def basin(self) -> Region:
        """Inside of the basin under the spout, from its floor to its rim."""
        return self.regions["basin0"]

    @property
    def regions(self) -> dict[str, Region]:
        """Inside of each basin; `basin0` is the one under the spout."""
        return {
            f"basin{i}": Region.between(
                self.name,
                (x0, -self.depth / 2 + WALL_M, -self.height / 2 + WALL_M),
                (x1, self.depth / 2 - WALL_M, self.height / 2),
            )
            for i, (x0, x1) in enumerate(self._basins())
        }

    def covers_beside(self) -> tuple[tuple[tuple[float, float], tuple[float, float]], ...]:
        """The faucet, behind the basin."""
        return (self.faucet_spot,)

    @property
    def faucet_spot(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Middle and half sizes of what the faucet covers of the counter, in the frame of the sink, metres."""
        left, right = _FAUCET_SIDES_M
        middle = ((left + right) / 2, self.depth / 2 + _FAUCET_BACK_M)
        return middle, ((right - left) / 2, _FAUCET_HALF_DEPTH_M)

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """`handle` and `spout` in radians, `temperature` as a share, `water_on`, `high`, `hot`, `left`, `right`."""
        side = self.spout_side(data)
        return {
            "handle": self.position(data, "handle"),
            "spout": self.position(data, "spout"),
            "temperature": self.share(data, "handle_temp"),
            "water_on": self.water_on(data),
            "high": self.position(data, "handle") / HANDLE_MAX > HIGH_FROM,
            "hot": self.share(data, "handle_temp") >= HOT_FROM,
            "left": side == "left",
            "right": side == "right",
        }

    def water_on(self, data: mujoco.MjData) -> bool:
        """Whether water runs."""
        return bool(WATER_FROM < self.position(data, "handle") % (2 * np.pi) < WATER_TO)

    def spout_side(self, data: mujoco.MjData) -> str:
        """Where the spout points: "left", "right" or "center"."""
        angle = self.position(data, "spout") % (2 * np.pi)
        if np.pi <= angle <= 2 * np.pi - SIDE_FROM:
            return "left"
        return "right" if SIDE_FROM <= angle < np.pi else "center"

    def set_water(self, data: mujoco.MjData, on: bool, draw: float = 0.5) -> None:
        """Turn the water on, at a share `draw` of the range of angles of a faucet that starts on, or off."""
        low, high = SET_ON
        # Strictly above the lower end, which does not count as on.
        self.set_position(data, "handle", low + max(draw, 0.01) * (high - low) if on else 0.0)

    def under_water(self, data: mujoco.MjData, point: NDArray[np.float64], radius: float) -> bool:
        """Whether an object of a horizontal radius (metres) at a world point stands in running water."""
        site = data.site(f"{self.name}_water").xpos
        inside = float(np.linalg.norm(point[:2] - site[:2])) < radius
        return bool(self.water_on(data) and inside and point[2] < site[2])

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """The stream follows the handles."""
        state = self.state(data)
        running = f"{'hot' if state['hot'] else 'cold'}_{'high' if state['high'] else 'low'}"
        for stream in _STREAMS:
            self.show(data, f"water_{stream}", float(bool(state["water_on"]) and stream == running))

    def _basins(self) -> list[tuple[float, float]]:
        """Inner x range of each basin; the first lies under the spout."""
        x0, x1 = -self.width / 2 + WALL_M, self.width / 2 - WALL_M
        if self.record["family"] != "double":
            return [(x0, x1)]
        divide = 0.13 * self.width
        return [(x0, divide - WALL_M / 2), (divide + WALL_M / 2, x1)]

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add basins, rim, drains and the faucet."""
        width, depth, height = self.size
        finish, metal = self.record["finish"], self.record["metal"]
        top, floor = height / 2, -height / 2
        parts.box(root, (0, 0, floor + WALL_M / 2), (width, depth, WALL_M), finish, name="floor")
        for side in (-1, 1):
            parts.box(root, (side * (width - WALL_M) / 2, 0, 0), (WALL_M, depth, height), finish)
            parts.box(root, (0, side * (depth - WALL_M) / 2, 0), (width - 2 * WALL_M, WALL_M, height), finish)
        basins = self._basins()
        if len(basins) == 2:
            wall = ((basins[0][1], -depth / 2 + WALL_M, floor), (basins[1][0], depth / 2 - WALL_M, top - 0.02))
            parts.span(root, *wall, finish)
        for x0, x1 in basins:
            spot = ((x0 + x1) / 2, depth * 0.08, floor + WALL_M)
            parts.tube(root, (spot[0], spot[1], spot[2] + 0.001), 0.042, 0.002, "chrome", collide=False)
            parts.tube(root, (spot[0], spot[1], spot[2] + 0.002), 0.026, 0.002, "iron", collide=False)
        rim = RIM_M
        for side in (-1, 1):
            bar = (rim, depth + 2 * rim, 0.006)
            parts.box(root, (side * (width + rim) / 2, 0, top + 0.0005), bar, finish, collide=False)
            bar = (width, rim, 0.006)
            parts.box(root, (0, side * (depth + rim) / 2, top + 0.0005), bar, finish, collide=False)
        self._add_faucet(parts, root, metal)

    def _add_faucet(self, parts: Parts, root: mujoco.MjsBody, metal: str) -> None:
        style = self.record["faucet"]
        y, z = self.depth / 2 + _FAUCET_BACK_M, self.height / 2
        parts.tube(root, (0, y, z + 0.004), 0.033, 0.008, metal, bevel=0.003)
        parts.tube(root, (0, y, z + 0.034), 0.023, 0.060, metal)
        if style == "bridge":
            for side in (-1, 1):
                parts.tube(root, (side * 0.10, y, z + 0.02), 0.018, 0.04, metal)
            parts.pipe(root, [(-0.10, y, z + 0.040), (0.10, y, z + 0.040)], 0.010, metal)
        spout = parts.hinge(
            root,
            "spout",
            (0, y, z + 0.064),
            (0, 0, 1),
            (-SPOUT_MAX, SPOUT_MAX),
            mass=0.6,
            size=(0.03, 0.2, 0.3),
            center=(0, -0.08, 0.15),
            friction=0.25,
            damping=0.3,
        )
        reach = _FAUCET_BACK_M + 0.42 * self.depth
        path = _spout_path(style, reach)
        parts.pipe(spout, path, 0.0125, metal, sides=8)
        tip = np.asarray(path[-1])
        if style == "pull_down":
            parts.tube(spout, tip - (0, 0, 0.02), 0.017, 0.06, metal if metal != "black" else "graphite", foot=True)
            tip = tip - np.array([0, 0, 0.05])
        else:
            parts.tube(spout, tip, 0.0155, 0.014, metal, foot=True)
            tip = tip - np.array([0, 0, 0.007])
        parts.site(spout, "water", tip)
        fall = float(tip[2]) + 0.064 + self.height - WALL_M
        for stream in _STREAMS:
            wide = 0.0095 if stream.endswith("high") else 0.0055
            colour = f"water_{stream.split('_')[0]}"
            lamp = parts.lamp(spout, f"water_{stream}", tip - (0, 0, HIDDEN_M), tip)
            parts.tube(lamp, (0, 0, -fall / 2), wide, fall, colour, segments=8, collide=False)
            parts.tube(lamp, (0, 0, -fall + 0.003), wide * 5.0, 0.002, colour, segments=10, collide=False)
        self._add_lever(parts, root, metal, y, z)

    def _add_lever(self, parts: Parts, root: mujoco.MjsBody, metal: str, y: float, z: float) -> None:
        """A lever on a hub: turning it sets the temperature, lifting it opens the water."""
        if self.record["faucet"] == "bridge":
            hub, out = np.array([0.10, y, z + 0.052]), np.array([0.75, -0.66, 0.0])
        elif self.record["lever"] == "side":
            hub, out = np.array([0.040, y, z + 0.042]), np.array([0.94, -0.34, 0.0])
            parts.pipe(root, [(0.0, y, z + 0.042), (0.040, y, z + 0.042)], 0.013, metal)
        else:
            hub, out = np.array([0.095, y, z + 0.046]), np.array([0.26, -0.97, 0.0])
            parts.tube(root, (0.095, y, z + 0.020), 0.021, 0.040, metal, bevel=0.003)
        out = out / np.linalg.norm(out)
        # Hot is to the left: seen from above that is clockwise for a lever that points to the front.
        turn = parts.hinge(
            root,
            "handle_temp",
            hub,
            (0, 0, -1),
            (0.0, TEMP_MAX),
            mass=0.05,
            size=(0.03, 0.03, 0.03),
            friction=0.06,
            damping=0.05,
            armature=0.003,
        )
        turn.joints[0].ref = TEMP_START * TEMP_MAX
        parts.tube(turn, (0, 0, 0.002), 0.0185, 0.026, metal, bevel=0.004, collide=False)
        # Lifting turns about the axis to the left of the lever's direction, downwards.
        axis = np.cross(out, [0.0, 0.0, 1.0])
        length = 0.105
        lever = parts.hinge(
            turn,
            "handle",
            (0, 0, 0.006),
            axis,
            (0.0, HANDLE_MAX),
            mass=0.06,
            size=(0.1, 0.02, 0.02),
            center=out * 0.04,
            friction=0.09,
            damping=0.05,
            armature=0.003,
        )
        tip = out * length + np.array([0, 0, 0.016])
        parts.pipe(lever, [(0, 0, 0.008), tip], 0.0075, metal, name="handle_lever")


def _spout_path(style: str, reach: float) -> list[tuple[float, float, float]]:
    """Middle line of a spout from its foot to its tip, metres; it reaches towards -y."""
    if style == "square":
        return [
            (0, 0, 0),
            (0, 0, 0.225),
            (0, -0.02, 0.245),
            (0, 0.018 - reach, 0.245),
            (0, -reach, 0.227),
            (0, -reach, 0.2),
        ]
    rise = {"gooseneck": 0.185, "pull_down": 0.215, "bridge": 0.15}[style]
    half = reach / 2
    arc = [(0.0, -half * (1 - np.cos(a)), rise + 0.9 * half * np.sin(a)) for a in np.linspace(0, np.pi, 8)]
    points = [(0.0, 0.0, 0.0), *arc]
    if style != "pull_down":
        points.append((0.0, -reach, rise - 0.03))
    return [(float(x), float(y), float(z)) for x, y, z in points]
