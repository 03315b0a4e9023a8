"""Wall ovens: a door that folds down, racks that slide out, knobs for time and temperature; lit while warm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Standing, Touches
from robocasa_lerobot.envs.kitchens.appliances.kinds.racked import Racked, fold_door, rack_words
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import SweptBox
from robocasa_lerobot.envs.kitchens.fixtures.swept import folded_down

DOOR_M, PANEL_M = 0.045, 0.105
_WALL_M = 0.035
LIT_FROM = 0.05  # share of the temperature knob


@dataclass
class Oven(Racked):
    """Knobs `knob_time` and `knob_temp`; racks `rack0`, and above it `rack1`."""

    standing: ClassVar[Standing] = Standing("built_in")
    looks: ClassVar = {"closed": {}, "open": {"door": 1.0, "rack0": 0.7}, "on": {"knob_temp": 0.6, "power": 1.0}}

    def parts_to_choose(self, name: str) -> dict[str, dict[str, str]]:
        """Its racks."""
        return {rack: {name: word} for rack, word in zip(self.racks, rack_words(len(self.racks)), strict=True)}

    def swept_areas(self) -> tuple[SweptBox, ...]:
        """Its open door."""
        return folded_down(self, self.door_span)

    @property
    def door_span(self) -> tuple[float, float]:
        """Lower and upper edge of the door in the fixture's frame, metres."""
        return -self.height / 2 + 0.012, self.height / 2 - PANEL_M - 0.004

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of the door, racks and knobs (`time`, `temperature`), and whether it is lit (`on`)."""
        state = super().state(data)
        state["time"], state["temperature"] = self.share(data, "knob_time"), self.share(data, "knob_temp")
        state["on"] = self.lit(data, "power")
        return state

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Light and display follow the temperature knob."""
        self.show(data, "power", float(self.share(data, "knob_temp") >= LIT_FROM))

    def cavity(self) -> tuple[np.ndarray, np.ndarray]:
        """Opposite corners of its inside in its frame, metres, each (3,)."""
        width, depth, height = self.size
        low = np.array([-width / 2 + _WALL_M, -depth / 2 + DOOR_M, -height / 2 + _WALL_M + 0.01])
        high = np.array([width / 2 - _WALL_M, depth / 2 - 0.05, height / 2 - PANEL_M - 0.012])
        return low, high

    def rack_levels(self) -> tuple[float, ...]:
        """Height of each rack from below, as a share of the cavity's."""
        return (0.25,) if self.record["racks"] == 1 else (0.14, 0.54)

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add case, panel with knobs, racks, light and door."""
        width, depth, height = self.size
        finish = self.record["finish"]
        front = -depth / 2
        low, high = self.cavity()
        walls = {
            "left": _WALL_M,
            "right": _WALL_M,
            "bottom": _WALL_M + 0.01,
            "top": PANEL_M + 0.012,
            "back": 0.05,
            "front": 0.0,
        }
        case = ((-width / 2, front + DOOR_M, -height / 2), (width / 2, depth / 2, height / 2))
        parts.shell(root, *case, walls, "graphite", "enamel")
        panel = "black" if finish in ("black", "black_steel") else finish
        parts.span(
            root, (-width / 2, front + 0.004, height / 2 - PANEL_M), (width / 2, front + DOOR_M, height / 2), panel
        )
        z = height / 2 - PANEL_M / 2
        parts.box(root, (0, front + 0.0035, z), (width * 0.30, 0.003, 0.05), "screen", collide=False)
        dark = panel in ("black", "graphite", "black_steel", "navy")
        for part, x in (("knob_time", -width * 0.32), ("knob_temp", width * 0.32)):
            parts.tube(root, (x, front + 0.003, z), 0.030, 0.002, "chrome", axis="y", collide=False)
            parts.knob(
                root, part, (x, front + 0.003, z), 0.0215, "silver" if dark else "graphite",
                "black" if dark else "white", limits=(0.0, 1.5 * np.pi), length=0.028,
            )  # fmt: skip
        lamp = parts.lamp(root, "power", (0, 0.012, 0), (0, 0, 0))
        for x in (-0.036, -0.014, 0.014, 0.036):
            parts.box(lamp, (x, front + 0.002, z), (0.014, 0.003, 0.026), "light_orange", collide=False)
        size = (high[0] - low[0] - 0.02, 0.004, high[2] - low[2] - 0.02)
        parts.box(lamp, (0, high[1] - 0.004, (low[2] + high[2]) / 2), size, "light_warm", collide=False)
        rack = (high[0] - low[0] - 0.012, high[1] - low[1] - 0.03, 0.005)
        for name in self.racks:
            body = self.add_rack(parts, root, name, rack, mass=1.0, reach=0.70, bars=9, back=0.005)
            parts.box(body, (0, -rack[1] / 2 + 0.004, 0.012), (rack[0], 0.008, 0.024), "wire")
        add_oven_door(parts, root, self.size, self.door_span, self.record)


def add_oven_door(
    parts: Parts, root: mujoco.MjsBody, size: tuple[float, float, float], span: tuple[float, float], record: object
) -> mujoco.MjsBody:
    """A door with a window that folds down, between two heights of an oven's front; joint `door_joint`."""
    width, depth, _ = size
    low, high = span
    door_w, door_h = width - 0.008, high - low
    finish, style = record["finish"], record["handle"]  # type: ignore[index]
    # Sprung in life: here friction carries its weight, so that it stays where it is left.
    door = fold_door(
        parts,
        root,
        (0, -depth / 2 + DOOR_M, low),
        (door_w, DOOR_M, door_h),
        mass=2.0,
        weight_at=(0.010, 0.35),
        friction=4.5,
        damping=1.5,
    )
    side, foot = door_w * 0.11, door_h * 0.14
    parts.pane(
        door, (-door_w / 2, -DOOR_M, 0), (door_w / 2, -0.001, door_h), finish, (side, side, foot, max(0.10, foot))
    )
    metal = "chrome" if finish in ("cream", "mint", "red", "navy", "sage") else "steel_plain"
    parts.handle(door, (0, -DOOR_M, door_h - 0.045), door_w * 0.8, metal, axis="x", name="handle", style=style)
    return door
