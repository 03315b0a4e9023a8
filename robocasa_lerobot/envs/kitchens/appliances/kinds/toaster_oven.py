"""Toaster ovens: a door that folds down and snaps shut, four knobs, racks; glowing while the timer runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Touches
from robocasa_lerobot.envs.kitchens.appliances.kinds.racked import Racked, fold_door, rack_words
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts

# docs/robocasa.md, section 7; the timer runs down over its whole range in 3000 control steps.
SNAP_BELOW, TIMER_STEPS = 0.01, 3000
_TICK_STEPS = 10  # the clockwork moves its knob twice a second
_RESTING_SHARE = 0.0005  # of the door: closer than this it is shut

DOOR_M, PANEL_M = 0.024, 0.095
_FOOT_M, _SILL_M = 0.018, 0.042
# Short of level, so that the handle of the open door keeps clear of the counter.
DOOR_MAX = 1.40
KNOBS = ("knob_function", "knob_temp", "knob_doneness", "knob_time")


@dataclass
class ToasterOven(Racked):
    """Knobs `knob_function`, `knob_temp`, `knob_doneness`, `knob_time`; racks `rack0`, and above it `rack1`."""

    rack_gap_m: ClassVar = 0.008
    rack_edge_m: ClassVar = (0.012, 0.01)
    memory_slots: ClassVar = 1  # control steps since the last tick
    looks: ClassVar = {
        "closed": {},
        "open": {"door": 1.0, "rack0": 0.6},
        "on": {"knob_time": 0.6, "knob_temp": 0.5, "power": 1.0},
    }

    def parts_to_choose(self, name: str) -> dict[str, dict[str, str]]:
        """Its racks."""
        words = rack_words(len(self.racks))
        return {rack: {name: f"{word} rack".strip()} for rack, word in zip(self.racks, words, strict=True)}

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of the door, racks and knobs (`temperature`, `time`, ...), and whether it heats (`on`)."""
        state = super().state(data)
        for knob, name in zip(KNOBS, ("function", "temperature", "doneness", "time"), strict=True):
            state[name] = self.share(data, knob)
        state["on"] = self.lit(data, "power")
        return state

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """The door snaps shut, the timer runs down, heating wires glow while it runs."""
        door = self.share(data, "door")
        if _RESTING_SHARE < door < SNAP_BELOW and not self.touched(model, contacts, "door"):
            self.set_share(data, "door", 0.0)
            self.wake(model, data, "door")
        memory = self.memory(data)
        time = self.share(data, "knob_time")
        running = time > 1e-4
        memory[0] = memory[0] + 1 if running else 0
        if memory[0] >= _TICK_STEPS:
            memory[0] = 0
            if not self.touched(model, contacts, "knob_time"):
                self.set_share(data, "knob_time", max(0.0, time - _TICK_STEPS / TIMER_STEPS))
                self.wake(model, data, "knob_time")
        self.show(data, "power", float(running))

    def cavity(self) -> tuple[np.ndarray, np.ndarray]:
        """Opposite corners of its inside in its frame, metres, each (3,)."""
        width, depth, height = self.size
        low = np.array([-width / 2 + 0.016, -depth / 2 + DOOR_M, -height / 2 + _FOOT_M + _SILL_M])
        high = np.array([width / 2 - PANEL_M, depth / 2 - 0.022, height / 2 - 0.026])
        return low, high

    def rack_levels(self) -> tuple[float, ...]:
        """Height of each rack from below, as a share of the cavity's."""
        return (0.24,) if self.record["racks"] == 1 else (0.20, 0.56)

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add case, panel with knobs, racks, heating wires and door."""
        width, depth, height = self.size
        finish = self.record["finish"]
        low, high = self.cavity()
        case_low = (-width / 2, -depth / 2 + DOOR_M, -height / 2 + _FOOT_M)
        walls = {"left": 0.016, "right": PANEL_M, "bottom": _SILL_M, "top": 0.026, "back": 0.022, "front": 0.0}
        parts.shell(root, case_low, (width / 2, depth / 2, height / 2), walls, finish, "cavity")
        for x in (-1, 1):
            for y in (-1, 1):
                spot = (x * (width / 2 - 0.04), y * (depth / 2 - 0.045), -height / 2 + _FOOT_M / 2)
                if self.record["feet"] == "round":
                    parts.tube(root, spot, 0.014, _FOOT_M, "rubber", segments=8)
                else:
                    parts.box(root, spot, (0.03, 0.03, _FOOT_M), "rubber")
        self._add_panel(parts, root)
        self._add_racks(parts, root)
        # Heating wires come up out of the floor while a lamp comes out of the panel.
        lamp = parts.lamp(root, "power", (0, 0.012, -0.014), (0, 0, 0))
        for share in (0.16, 0.50, 0.84):
            spot = ((low[0] + high[0]) / 2, low[1] + share * (high[1] - low[1]), low[2] + 0.006)
            parts.box(lamp, spot, (high[0] - low[0] - 0.03, 0.012, 0.008), "light_orange", collide=False)
        spot = (width / 2 - PANEL_M / 2, -depth / 2 - 0.001, height / 2 - 0.010)
        parts.box(lamp, spot, (0.022, 0.003, 0.006), "light_red", collide=False)
        self._add_door(parts, root)

    def _add_panel(self, parts: Parts, root: mujoco.MjsBody) -> None:
        width, depth, height = self.size
        finish, retro = self.record["finish"], self.record["family"] == "retro"
        x, front = width / 2 - PANEL_M / 2, -depth / 2
        colour = finish if retro or finish in ("white", "silver") else "black"
        low = (width / 2 - PANEL_M, front, -height / 2 + _FOOT_M)
        parts.span(root, low, (width / 2, front + DOOR_M, height / 2), colour)
        light = finish in ("white", "silver") or retro
        body, pointer = ("chrome", "black") if retro else (("graphite", "white") if light else ("silver", "black"))
        usable = height - _FOOT_M
        for index, knob in enumerate(KNOBS):
            z = height / 2 - usable * (0.15 + 0.235 * index)
            parts.tube(root, (x, front, z), 0.025, 0.002, "chrome" if not retro else "white", axis="y", collide=False)
            parts.knob(root, knob, (x, front, z), 0.0185, body, pointer, limits=(0.0, 1.5 * np.pi), length=0.024)

    def _add_racks(self, parts: Parts, root: mujoco.MjsBody) -> None:
        low, high = self.cavity()
        size = (high[0] - low[0] - 0.008, high[1] - low[1] - 0.012, 0.005)
        for rack in self.racks:
            body = self.add_rack(parts, root, rack, size, mass=0.4, reach=0.62, bars=8, friction=0.8, damping=5.0)
            # A lip at the front to pull and push it by.
            parts.box(body, (0, -size[1] / 2 + 0.003, 0.009), (size[0], 0.006, 0.018), "wire")

    def _add_door(self, parts: Parts, root: mujoco.MjsBody) -> None:
        width, depth, height = self.size
        finish = self.record["finish"]
        low, _ = self.cavity()
        bottom = float(low[2]) - 0.012
        door_w, door_h = width - PANEL_M - 0.003, height / 2 - 0.006 - bottom
        middle = -PANEL_M / 2
        # Counterweighted like the real ones: its friction carries the weight at every angle.
        door = fold_door(
            parts,
            root,
            (middle, -depth / 2 + DOOR_M, bottom),
            (door_w, DOOR_M, door_h),
            mass=0.5,
            weight_at=(0.006, 0.4),
            friction=0.9,
            damping=0.3,
            limit=DOOR_MAX,
            armature=0.01,
        )
        frame = finish if self.record["family"] == "retro" else ("black" if finish == "black" else finish)
        parts.pane(door, (-door_w / 2, -DOOR_M, 0), (door_w / 2, -0.001, door_h), frame, (0.022, 0.022, 0.022, 0.058))
        metal = "chrome" if self.record["family"] == "retro" else "steel_plain"
        parts.handle(
            door, (0, -DOOR_M, door_h - 0.028), door_w * 0.72, metal, axis="x", name="handle",
            style=self.record["handle"],
        )  # fmt: skip
