"""Toasters: slots with a lift that a lever lowers; it is held down, glows, and pops after 25 s."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region

# Thresholds and times in control steps of 50 ms (docs/robocasa.md, section 7).
ON_FROM, COOL_BELOW = 0.90, 0.70
HELD_STEPS, COOLDOWN_STEPS = 500, 1000

TRAVEL_M = 0.050
LEVER_M = 0.038  # room beside the body for the lever
SLOT_WIDTH_M, SLOT_GAP_M = 0.036, 0.018
_WELL_M = 0.120  # depth of a slot
_WALL_M = 0.004


@dataclass
class Toaster(Appliance):
    """One lever for each pair of slots (`lever0`, for four slots also `lever1`)."""

    memory_slots: ClassVar = 4  # steps left until the pop and of the cooldown, by side

    looks: ClassVar = {"up": {}, "on": {"lever0": 1.0, "heat0": 1.0}}

    def parts_to_choose(self, name: str) -> dict[str, dict[str, str]]:
        """Its slots, with the side of each, `_side`."""
        return {str(slot): {"_side": str(slot // 2)} for slot in range(2 * self.sides)}

    @property
    def sides(self) -> int:
        """Number of levers."""
        return int(self.record["slots"]) // 2

    @property
    def regions(self) -> dict[str, Region]:
        """The slots, above their lift; `slot0`, `slot1` belong to `lever0`; they move with it."""
        regions = {}
        for side in range(self.sides):
            for index, (x, y) in enumerate(self._slots(side)):
                half_x, half_y = self._slot_half()
                regions[f"slot{2 * side + index}"] = Region(
                    f"{self.name}_lever{side}", (x, y, 0.028), (half_x, half_y, 0.028)
                )
        return regions

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """`lever<i>`, 1 when down, and `on<i>` by side."""
        state: dict[str, float | bool] = {}
        for side in range(self.sides):
            state[f"lever{side}"] = self.share(data, f"lever{side}")
            state[f"on{side}"] = self.lit(data, f"heat{side}")
        return state

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Hold a lowered lever for 25 s, then let it pop and cool down."""
        memory = self.memory(data)
        for side in range(self.sides):
            lever, share = f"lever{side}", self.share(data, f"lever{side}")
            left, cooldown = memory[2 * side : 2 * side + 2]
            if left > 0:
                left -= 1
                if left == 0:
                    self.catch(model, data, lever, held=False)
                    cooldown = COOLDOWN_STEPS
            elif cooldown > 0:
                cooldown = 0 if share <= COOL_BELOW else cooldown - 1
            elif share >= ON_FROM:
                left = HELD_STEPS
                self.catch(model, data, lever, held=True)
            memory[2 * side : 2 * side + 2] = left, cooldown
            self.show(data, f"heat{side}", left > 0)

    def _body(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre and size of the body, which leaves room for the lever within the box."""
        width, depth, height = self.size
        if self.sides == 1:
            return np.array([-LEVER_M / 2, 0.0, 0.0]), np.array([width - LEVER_M, depth, height])
        return np.array([0.0, LEVER_M / 2, 0.0]), np.array([width, depth - LEVER_M, height])

    def _slot_half(self) -> tuple[float, float]:
        _, size = self._body()
        length = min((size[0] if self.sides == 1 else size[1]) - 0.075, 0.165)
        half = (length / 2, SLOT_WIDTH_M / 2)
        return half if self.sides == 1 else half[::-1]

    def _slots(self, side: int) -> list[tuple[float, float]]:
        """Middles of a side's slots in the fixture's frame."""
        centre, size = self._body()
        pitch = (SLOT_WIDTH_M + SLOT_GAP_M) / 2
        if self.sides == 1:
            return [(centre[0], centre[1] - pitch), (centre[0], centre[1] + pitch)]
        middle = centre[0] + (side - 0.5) * size[0] * 0.47
        return [(middle - pitch, centre[1]), (middle + pitch, centre[1])]

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add the body around its slots, lifts with levers, heating wires and dials."""
        finish = self.record["finish"]
        centre, size = self._body()
        width, depth, height = (float(v) for v in size)
        foot = 0.022
        parts.block(
            root,
            (centre[0], centre[1], -height / 2 + foot / 2),
            (width * 0.97, depth * 0.97, foot),
            self.record["corner"] * 0.8,
            self.record["base"],
        )
        shoulder = 0.016 if self.record["family"] != "retro" else 0.030
        skin = _shoulders((width, depth, height - foot), self.record["corner"], shoulder)
        parts.mesh(root, skin, (centre[0], centre[1], foot / 2), finish)
        half_x, half_y = self._slot_half()
        slots = [slot for side in range(self.sides) for slot in self._slots(side)]
        top, bottom = height / 2, height / 2 - _WELL_M
        self._add_top(parts, root, finish, slots, shoulder)
        # What fills the body up to the slots, for contact.
        x0, x1 = centre[0] - width / 2 + 0.006, centre[0] + width / 2 - 0.006
        y0, y1 = centre[1] - depth / 2 + 0.006, centre[1] + depth / 2 - 0.006
        parts.blocker(root, (centre[0], centre[1], (bottom - height / 2) / 2), (x1 - x0, y1 - y0, height - _WELL_M))
        for low, high in _around((x0, x1, y0, y1), slots, (half_x, half_y)):
            middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (top + bottom) / 2 - 0.002)
            parts.blocker(root, middle, (high[0] - low[0], high[1] - low[1], _WELL_M - 0.004))
        for x, y in slots:
            self._add_well(parts, root, (x, y), (half_x, half_y), (bottom, top))
        for side in range(self.sides):
            self._add_lever(parts, root, side)

    def _add_top(
        self, parts: Parts, root: mujoco.MjsBody, finish: str, slots: list[tuple[float, float]], shoulder: float
    ) -> None:
        centre, size = self._body()
        inset = shoulder
        plate = (
            centre[0] - size[0] / 2 + inset,
            centre[0] + size[0] / 2 - inset,
            centre[1] - size[1] / 2 + inset,
            centre[1] + size[1] / 2 - inset,
        )
        top = self.height / 2
        cover = "black" if self.record["base"] == "black" and finish not in ("black", "graphite") else "chrome"
        for low, high in _around(plate, slots, self._slot_half()):
            parts.span(root, (*low, top - 0.006), (*high, top - 0.0005), cover, collide=False)

    def _add_well(
        self,
        parts: Parts,
        root: mujoco.MjsBody,
        middle: tuple[float, float],
        half: tuple[float, float],
        levels: tuple[float, float],
    ) -> None:
        x, y = middle
        z, tall = (levels[0] + levels[1]) / 2, levels[1] - levels[0] - 0.008
        for sign in (-1, 1):
            parts.box(root, (x + sign * (half[0] - 0.001), y, z), (0.002, 2 * half[1], tall), "iron", collide=False)
            parts.box(root, (x, y + sign * (half[1] - 0.001), z), (2 * half[0], 0.002, tall), "iron", collide=False)
        parts.span(
            root,
            (x - half[0], y - half[1], levels[0] - 0.002),
            (x + half[0], y + half[1], levels[0]),
            "iron",
            collide=False,
        )

    def _add_lever(self, parts: Parts, root: mujoco.MjsBody, side: int) -> None:
        centre, size = self._body()
        slots, (half_x, half_y) = self._slots(side), self._slot_half()
        lift_z = self.height / 2 - _WELL_M + TRAVEL_M + 0.012
        lever = parts.slide(
            root,
            f"lever{side}",
            (0, 0, lift_z),
            (0, 0, -1),
            (0.0, TRAVEL_M),
            mass=0.08,
            size=(0.1, 0.05, 0.02),
            friction=0.15,
            damping=4.0,
            armature=0.02,
        )
        # Lifts lever and bread: 2.4 N at the top, 6 N at the bottom.
        parts.spring(lever, 70.0, -0.035)
        parts.hold(f"lever{side}", TRAVEL_M)
        for x, y in slots:
            parts.box(lever, (x, y, -0.003), (2 * half_x - 0.012, 2 * half_y - 0.012, 0.006), "wire")
        z = self.height / 2 - 0.052 - lift_z
        if self.sides == 1:
            face = centre[0] + size[0] / 2
            parts.box(lever, (face + 0.006, 0, z), (0.016, 0.010, 0.008), "chrome")
            parts.box(lever, (face + 0.024, 0, z), (0.026, 0.044, 0.018), "black")
            slit = ((face - 0.0005, 0, self.height / 2 - 0.052 - TRAVEL_M / 2), (0.003, 0.010, TRAVEL_M + 0.016))
            dial = (face, size[1] * 0.30, -self.height * 0.22)
            facing = "x"
        else:
            face, x = centre[1] - size[1] / 2, (slots[0][0] + slots[1][0]) / 2
            parts.box(lever, (x, face - 0.006, z), (0.010, 0.016, 0.008), "chrome")
            parts.box(lever, (x, face - 0.024, z), (0.044, 0.026, 0.018), "black")
            slit = ((x, face + 0.0005, self.height / 2 - 0.052 - TRAVEL_M / 2), (0.010, 0.003, TRAVEL_M + 0.016))
            dial = (x, face, -self.height * 0.34)
            facing = "y"
        parts.box(root, *slit, "iron", collide=False)
        if self.record["dial"] and (facing == "y" or side == 0):
            out = (0.005, 0, 0) if facing == "x" else (0, -0.005, 0)
            parts.tube(root, np.add(dial, out), 0.014, 0.010, "chrome", axis=facing, bevel=0.003)
        # Glowing wires come up along the walls of the slots.
        lamp = parts.lamp(root, f"heat{side}", (0, 0, -0.045), (0, 0, 0))
        bottom = self.height / 2 - _WELL_M
        for x, y in slots:
            for sign in (-1, 1):
                for level in (0.042, 0.060, 0.078):
                    if self.sides == 1:
                        spot, bar = (x, y + sign * (half_y - 0.003), bottom + level), (2 * half_x - 0.02, 0.003, 0.004)
                    else:
                        spot, bar = (x + sign * (half_x - 0.003), y, bottom + level), (0.003, 2 * half_y - 0.02, 0.004)
                    parts.box(lamp, spot, bar, "light_orange", collide=False)


def _shoulders(size: tuple[float, float, float], radius: float, shoulder: float) -> meshes.Mesh:
    """A body whose upper edge is rounded, without its top face."""
    width, depth, height = size
    rings = [meshes.rounded_rectangle(width, depth, -height / 2, radius)]
    for angle in np.linspace(0, np.pi / 2, 4):
        inset = shoulder * (1 - np.cos(angle))
        rings.append(
            meshes.rounded_rectangle(
                width - 2 * inset,
                depth - 2 * inset,
                height / 2 - shoulder * (1 - np.sin(angle)),
                max(radius - inset, 0.002),
            )
        )
    return meshes.loft(rings, caps=False)


def _around(
    frame: tuple[float, float, float, float], slots: list[tuple[float, float]], half: tuple[float, float]
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Rectangles (low, high corner) that fill a frame (x0, x1, y0, y1) around a row of equal slots."""
    x0, x1, y0, y1 = frame
    along = 0 if abs(slots[0][0] - slots[-1][0]) > abs(slots[0][1] - slots[-1][1]) else 1
    out: list[tuple[tuple[float, float], tuple[float, float]]] = []
    if along == 0:  # slots follow each other along x
        y_low, y_high = slots[0][1] - half[1], slots[0][1] + half[1]
        out += [((x0, y0), (x1, y_low)), ((x0, y_high), (x1, y1))]
        edges = [x0, *(v for x, _ in slots for v in (x - half[0], x + half[0])), x1]
        out += [((edges[i], y_low), (edges[i + 1], y_high)) for i in range(0, len(edges), 2)]
    else:
        x_low, x_high = slots[0][0] - half[0], slots[0][0] + half[0]
        out += [((x0, y0), (x_low, y1)), ((x_high, y0), (x1, y1))]
        edges = [y0, *(v for _, y in slots for v in (y - half[1], y + half[1])), y1]
        out += [((x_low, edges[i]), (x_high, edges[i + 1])) for i in range(0, len(edges), 2)]
    return out
