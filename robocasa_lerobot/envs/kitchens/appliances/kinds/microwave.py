"""Microwaves: a door with a window, a start and a stop button, a turntable; lit inside while on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import OPEN_FROM, Appliance, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region, SweptBox
from robocasa_lerobot.envs.kitchens.fixtures.swept import open_doors

DOOR_M, PANEL_M = 0.030, 0.105
_WALLS = {"left": 0.018, "right": PANEL_M, "bottom": 0.022, "top": 0.018, "back": 0.035, "front": 0.0}
_TURNTABLE_M = 0.012
_WINDOW_MARGINS = {
    "wide": (0.045, 0.065, 0.045, 0.045),
    "tall": (0.065, 0.075, 0.030, 0.030),
    "full": (0.020, 0.055, 0.020, 0.020),
}


@dataclass
class Microwave(Appliance):
    """On from a touch of the start button until one of the stop button, or until the door opens."""

    @property
    def doors(self) -> tuple[str, ...]:
        """The door."""
        return ("door",)

    @property
    def regions(self) -> dict[str, Region]:
        """Above the turntable."""
        low, high = self._cavity()
        low[2] += _TURNTABLE_M
        return {"interior": Region.between(self.name, low, high)}

    def swept_areas(self) -> tuple[SweptBox, ...]:
        """Its open door."""
        return open_doors(self, ("left",), self.door_width)

    @property
    def door_width(self) -> float:
        """From the hinge, at its left, to the panel with the buttons, metres."""
        return self.size[0] - PANEL_M

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """`door` as a share of its range, and whether it is `on`."""
        return {"door": self.share(data, "door"), "on": self.lit(data, "power")}

    def set_on(self, data: mujoco.MjData, on: bool) -> None:
        """Start or stop it; for initial states."""
        self.set_share(data, "power", float(on))

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Start and stop by touch; off while the door is open."""
        on = self.lit(data, "power")
        if self.touched(model, contacts, "start_button"):
            on = True
        if self.touched(model, contacts, "stop_button") or self.share(data, "door") >= OPEN_FROM:
            on = False
        self.show(data, "power", on)

    def _cavity(self) -> tuple[np.ndarray, np.ndarray]:
        width, depth, height = self.size
        low = np.array([-width / 2 + _WALLS["left"], -depth / 2 + DOOR_M, -height / 2 + _WALLS["bottom"]])
        high = np.array([width / 2 - PANEL_M, depth / 2 - _WALLS["back"], height / 2 - _WALLS["top"]])
        return low, high

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add case, turntable, panel, buttons, lights and door."""
        width, depth, height = self.size
        finish, retro = self.record["finish"], self.record["family"] == "retro"
        front = -depth / 2
        parts.shell(
            root,
            (-width / 2, front + DOOR_M, -height / 2),
            (width / 2, depth / 2, height / 2),
            _WALLS,
            finish,
            "cavity",
        )
        low, high = self._cavity()
        middle = (low + high) / 2
        radius = min(high[0] - low[0], high[1] - low[1]) / 2 - 0.012
        parts.tube(root, (middle[0], middle[1], low[2] + _TURNTABLE_M / 2), radius, _TURNTABLE_M, "shelf_glass")
        self._add_panel(parts, root, finish, retro)
        door = parts.hinge(
            root,
            "door",
            (-width / 2, front + DOOR_M, 0),
            (0, 0, 1),
            (-np.pi / 2, 0.0),
            mass=1.5,
            size=(width - PANEL_M, DOOR_M, height),
            center=((width - PANEL_M) / 2, -DOOR_M / 2, 0),
            friction=0.25,
            damping=0.5,
            armature=0.02,
        )
        door_w = width - PANEL_M - 0.003
        frame = "black" if self.record["family"] == "frameless" else finish
        edge = height / 2 - 0.002
        parts.pane(door, (0, -DOOR_M, -edge), (door_w, -0.001, edge), frame, _WINDOW_MARGINS[self.record["window"]])
        metal = "chrome" if retro else "steel_plain"
        length = height * (0.62 if self.record["handle"] == "slim" else 0.7)
        parts.handle(
            door, (door_w - 0.026, -DOOR_M, 0), length, metal, axis="z", name="handle", style=self.record["handle"]
        )

    def _add_panel(self, parts: Parts, root: mujoco.MjsBody, finish: str, retro: bool) -> None:
        width, depth, height = self.size
        front = -depth / 2
        x = width / 2 - PANEL_M / 2
        colour = finish if retro else "black"
        parts.span(root, (width / 2 - PANEL_M, front, -height / 2), (width / 2, front + DOOR_M, height / 2), colour)
        display_z = height * 0.34
        parts.box(root, (x, front - 0.0005, display_z), (0.078, 0.003, 0.034), "screen", collide=False)
        controls = self.record["controls"]
        if controls == "keypad":
            for row in range(3):
                for column in range(3):
                    key = (x + (column - 1) * 0.026, front - 0.0005, height * (0.18 - 0.10 * row))
                    parts.box(root, key, (0.018, 0.003, 0.014), "graphite", collide=False)
        elif controls == "dials":
            parts.tube(root, (x, front - 0.010, height * 0.08), 0.024, 0.020, "chrome", axis="y", bevel=0.004)
            parts.box(root, (x, front - 0.021, height * 0.08 + 0.010), (0.004, 0.002, 0.016), "black", collide=False)
        elif controls == "strip":
            parts.box(root, (x, front - 0.0005, height * 0.05), (0.006, 0.003, height * 0.30), "silver", collide=False)
        start_z, stop_z = -0.20 * height, -0.37 * height
        button = "silver" if finish != "silver" else "white"
        for part, z, mark in (("start_button", start_z, "light_green"), ("stop_button", stop_z, "light_red")):
            body = parts.button(root, part, (x, front - 0.009, z), (0.062, 0.028, 0.013), button)
            parts.box(body, (0, -0.0005, 0), (0.014, 0.002, 0.006), mark, collide=False)
        # Display, lamp and the light inside come out of their covers together.
        lamp = parts.lamp(root, "power", (0, 0.012, 0), (0, 0, 0))
        for digit in (-0.022, -0.008, 0.010, 0.024):
            parts.box(lamp, (x + digit, front - 0.002, display_z), (0.009, 0.003, 0.020), "light_cyan", collide=False)
        parts.box(lamp, (x, front - 0.0015, start_z + 0.026), (0.062, 0.003, 0.006), "light_green", collide=False)
        low, high = self._cavity()
        size = (high[0] - low[0] - 0.02, 0.004, high[2] - low[2] - 0.02)
        parts.box(
            lamp, ((low[0] + high[0]) / 2, high[1] - 0.004, (low[2] + high[2]) / 2), size, "light_warm", collide=False
        )

    looks: ClassVar = {"closed": {}, "open": {"door": 1.0}, "on": {"power": 1.0}}
