"""Coffee machines: a place for a cup under the spout, and a start button that stays lit once touched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import HIDDEN_M, Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region

POUR_STEPS = 160  # control steps that coffee is seen to run
_TRAY_M, _CUP_ROOM_M = 0.030, 0.145
# Of a mug's middle to where it belongs, horizontally and up or down, metres (docs/robocasa.md, section 7).
UNDER_SPOUT_M = (0.04, 0.10)
_PLACE_ABOVE_TRAY_M = 0.045


@dataclass
class CoffeeMachine(Appliance):
    """On from the first touch of `start_button`, for good."""

    memory_slots: ClassVar = 1  # control steps since it was started
    looks: ClassVar = {"off": {}, "on": {"power": 1.0, "pour": 1.0}}

    @property
    def regions(self) -> dict[str, Region]:
        """Under the spout, on the tray; the site `<name>_receptacle` is where a mug's middle belongs."""
        x, y, z = self.place
        half = (self.width * 0.3, 0.05, _CUP_ROOM_M / 2)
        return {"cup": Region(self.name, (x, y, z - _PLACE_ABOVE_TRAY_M + half[2]), half)}

    @property
    def place(self) -> tuple[float, float, float]:
        """Where the middle of a mug belongs, in the fixture's frame."""
        return (0.0, -self.depth / 2 + self._tray_depth() * 0.52, -self.height / 2 + _TRAY_M + _PLACE_ABOVE_TRAY_M)

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Whether it is `on`."""
        return {"on": self.lit(data, "power")}

    def set_on(self, data: mujoco.MjData, on: bool) -> None:
        """Switch it; for initial states."""
        self.set_share(data, "power", float(on))

    def under_spout(self, data: mujoco.MjData, point: NDArray[np.float64]) -> bool:
        """Whether a mug with its middle at a world point stands where the coffee runs."""
        away = data.site(f"{self.name}_receptacle").xpos - point
        return bool(np.linalg.norm(away[:2]) < UNDER_SPOUT_M[0] and abs(away[2]) < UNDER_SPOUT_M[1])

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Start by touch; coffee runs for a while."""
        memory = self.memory(data)
        on = self.lit(data, "power")
        if not on and self.touched(model, contacts, "start_button"):
            on, memory[0] = True, 0
        self.show(data, "power", float(on))
        self.show(data, "pour", float(on and memory[0] < POUR_STEPS))
        memory[0] += on

    def _top(self) -> float:
        """Height of the head's top in the fixture's frame, below a hopper, a lever or a rail that reaches higher."""
        return self.height / 2 - {"hopper": 0.062, "lever": 0.026, "rail": 0.017, "flat": 0.0}[self.record["top"]]

    def _tray_depth(self) -> float:
        return min(0.62 * self.depth, 0.17)

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add tray, back, head with spout and button, and what belongs to the design."""
        width, depth, height = self.size
        family, finish, accent = self.record["family"], self.record["finish"], self.record["accent"]
        front, bottom, top = -depth / 2, -height / 2, self._top()
        tray_d = self._tray_depth()
        radius = {"espresso": 0.012, "capsule": 0.045, "bean_to_cup": 0.015, "pod": 0.035}[family]
        head_z = bottom + _TRAY_M + _CUP_ROOM_M
        head_h = top - head_z
        back_d = depth - tray_d
        dark = "black" if finish != "black" else "graphite"
        # Foot and tray.
        parts.block(
            root,
            (0, 0, bottom + _TRAY_M / 2),
            (width, depth, _TRAY_M),
            radius,
            dark if family == "espresso" else finish,
        )
        x, y, _ = self.place
        self._add_tray(parts, root, (x, y, bottom + _TRAY_M), tray_d)
        # Back and head.
        back = (width * (1.0 if family != "capsule" else 0.92), back_d, top - bottom - _TRAY_M)
        parts.block(root, (0, depth / 2 - back_d / 2, (bottom + top + _TRAY_M) / 2), back, radius, finish)
        head_d = depth * (0.96 if family != "pod" else 0.99)
        parts.block(
            root, (0, depth / 2 - head_d / 2, head_z + head_h / 2), (width, head_d, head_h), radius, finish, bevel=0.008
        )
        # Panel behind the cup, and the spout.
        panel = (width * 0.8, 0.004, _CUP_ROOM_M - 0.006)
        parts.box(root, (0, front + tray_d - 0.001, bottom + _TRAY_M + _CUP_ROOM_M / 2), panel, dark, collide=False)
        face = depth / 2 - head_d
        self._add_spout(parts, root, (x, y, head_z), finish, accent)
        button_z = head_z + head_h * (0.5 if family != "espresso" else 0.62)
        self._add_start(parts, root, face, button_z)
        self._add_details(parts, root, face, head_z, head_h, accent)

    def _add_tray(self, parts: Parts, root: mujoco.MjsBody, middle: tuple[float, float, float], deep: float) -> None:
        x, y, z = middle
        style = self.record["tray"]
        wide = self.width * 0.84
        if style == "round":
            parts.mesh(root, meshes.disc(min(wide / 2, deep * 0.46), 16), (x, y, z + 0.0005), "chrome")
            parts.mesh(root, meshes.disc(min(wide / 2, deep * 0.46) * 0.8, 16), (x, y, z + 0.001), "iron")
            return
        parts.box(root, (x, y, z), (wide, deep * 0.86, 0.002), "steel_plain", collide=False)
        for share in np.linspace(-0.4, 0.4, 5):
            size = (wide * 0.92, 0.006, 0.001) if style == "slots" else (0.006, deep * 0.78, 0.001)
            spot = (x, y + share * deep * 0.8, z + 0.0012) if style == "slots" else (x + share * wide, y, z + 0.0012)
            parts.box(root, spot, size, "iron", collide=False)

    def _add_spout(
        self, parts: Parts, root: mujoco.MjsBody, middle: tuple[float, float, float], finish: str, accent: str
    ) -> None:
        x, y, z = middle
        if self.record["family"] == "espresso":
            # Group head, and a portafilter with its handle to the front.
            parts.tube(root, (x, y, z - 0.008), 0.034, 0.020, "chrome", collide=False)
            parts.tube(root, (x, y, z - 0.024), 0.030, 0.014, "steel_plain", collide=False)
            grip = "oak" if accent == "oak" else "black"
            parts.pipe(root, [(x, y - 0.028, z - 0.024), (x, y - 0.11, z - 0.028)], 0.011, grip, sides=8)
            for side in (-1, 1):
                parts.tube(root, (x + side * 0.008, y, z - 0.035), 0.005, 0.012, "chrome", segments=8, collide=False)
        else:
            nozzle = "black" if finish not in ("black", "graphite") else "silver"
            parts.block(root, (x, y, z - 0.010), (0.052, 0.045, 0.022), 0.012, nozzle, collide=False)
            for side in (-1, 1):
                parts.tube(root, (x + side * 0.010, y, z - 0.024), 0.006, 0.010, "chrome", segments=8, collide=False)
        low = -self.height / 2 + _TRAY_M
        lamp = parts.lamp(root, "pour", (x, y, z - 0.028 - HIDDEN_M), (x, y, z - 0.028))
        fall = z - 0.028 - low - 0.002
        for side in (-1, 1):
            parts.tube(lamp, (side * 0.009, 0, -fall / 2), 0.0028, fall, "coffee", segments=6, collide=False)
        parts.site(root, "receptacle", self.place)
        parts.site(root, "pour", (x, y, z - 0.03))

    def _add_start(self, parts: Parts, root: mujoco.MjsBody, face: float, z: float) -> None:
        x = self.width * (0.0 if self.record["family"] in ("capsule", "pod") else 0.27)
        finish = "silver" if self.record["finish"] not in ("silver", "steel", "white", "cream") else "black"
        parts.tube(root, (x, face - 0.001, z), 0.0225, 0.004, "chrome", axis="y", collide=False)
        parts.button(root, "start_button", (x, face - 0.013, z), (0.034, 0.034, 0.015), finish, round_=True)
        lamp = parts.lamp(root, "power", (0, 0.012, 0), (0, 0, 0))
        parts.tube(lamp, (x, face - 0.0025, z), 0.0215, 0.003, "light_green", axis="y", segments=14, collide=False)

    def _add_details(
        self, parts: Parts, root: mujoco.MjsBody, face: float, head_z: float, head_h: float, accent: str
    ) -> None:
        width, depth, height = self.size
        family, top = self.record["family"], self._top()
        if family == "espresso":
            parts.tube(
                root, (-width * 0.27, face - 0.006, head_z + head_h * 0.62), 0.021, 0.014, "label", axis="y",
                collide=False,
            )  # fmt: skip
            parts.box(
                root,
                (-width * 0.27, face - 0.0135, head_z + head_h * 0.66),
                (0.003, 0.002, 0.014),
                "light_red",
                collide=False,
            )
            wand = [
                (width * 0.36, face + 0.012, head_z),
                (width * 0.38, face - 0.012, head_z - 0.03),
                (width * 0.38, face - 0.012, head_z - 0.105),
            ]
            parts.pipe(root, wand, 0.005, "chrome", collide=False)
            if self.record["top"] == "rail":
                for y in (-0.36, 0.40):
                    parts.box(root, (0, y * depth, top + 0.014), (width * 0.9, 0.005, 0.005), "chrome", collide=False)
                for x in (-0.45, 0.45):
                    parts.box(
                        root,
                        (x * width, 0.02 * depth, top + 0.014),
                        (0.005, depth * 0.76, 0.005),
                        "chrome",
                        collide=False,
                    )
                    for y in (-0.36, 0.40):
                        parts.box(
                            root, (x * width, y * depth, top + 0.007), (0.005, 0.005, 0.014), "chrome", collide=False
                        )
        elif family == "bean_to_cup":
            parts.block(
                root, (0, depth * 0.16, top + 0.026), (width * 0.7, depth * 0.42, 0.052), 0.02, "smoked_glass",
                taper=1.1, collide=False,
            )  # fmt: skip
            parts.block(root, (0, depth * 0.16, top + 0.056), (width * 0.78, depth * 0.47, 0.010), 0.02, "black")
            parts.box(
                root,
                (-width * 0.12, face - 0.001, head_z + head_h * 0.5),
                (width * 0.42, 0.004, head_h * 0.42),
                "screen",
                collide=False,
            )
        else:
            parts.box(
                root, (0, depth / 2 + 0.001, 0.02), (width * 0.7, 0.004, height * 0.5), "smoked_glass", collide=False
            )
            if self.record["top"] == "lever":
                arm = [
                    (-width * 0.38, 0.02, top - 0.01),
                    (-width * 0.38, face + 0.02, top + 0.018),
                    (width * 0.38, face + 0.02, top + 0.018),
                    (width * 0.38, 0.02, top - 0.01),
                ]
                parts.pipe(root, arm, 0.007, accent if accent != "oak" else "chrome")
            parts.box(root, (0, face - 0.001, head_z + 0.008), (width * 0.8, 0.004, 0.006), accent, collide=False)
