"""Electric kettles: a lid that springs open at the touch of a button, a switch that turns itself off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts

# docs/robocasa.md, section 7; times in control steps.
ON_FROM, ON_STEPS = 0.95, 500
PRESSED_FROM, SHUT_UP_TO = 0.1, 0.01

LID_MAX = 1.35  # radians
_SWITCH_M = 0.014
_BASE_M = 0.020


@dataclass
class ElectricKettle(Appliance):
    """The handle is to the front; parts `lid`, `lid_button` on the handle, `switch` below it."""

    memory_slots: ClassVar = 1  # control steps left until it switches off
    looks: ClassVar = {"off": {}, "open": {"lid": 1.0}, "on": {"switch": 1.0, "power": 1.0}}

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of `lid`, `lid_button` and `switch`, and whether it is `on`."""
        state: dict[str, float | bool] = {part: self.share(data, part) for part in ("lid", "lid_button", "switch")}
        state["on"] = self.lit(data, "power")
        return state

    def set_lid(self, data: mujoco.MjData, share: float) -> None:
        """Open the lid by a share of its range; for initial states."""
        self.set_share(data, "lid", share)
        data.eq_active[data.model.equality(f"{self.name}_lid_hold").id] = share <= SHUT_UP_TO

    def set_share(self, data: mujoco.MjData, part: str, share: float) -> None:
        """Put a part at a share of its range; a lid that is not shut is not held."""
        super().set_share(data, part, share)
        if part == "lid":
            data.eq_active[data.model.equality(f"{self.name}_lid_hold").id] = share <= SHUT_UP_TO

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Hold the switch until the water boils; let the lid spring open, and catch it when it is pushed shut."""
        memory = self.memory(data)
        if memory[0] > 0:
            memory[0] -= 1
            if memory[0] == 0:
                self.catch(model, data, "switch", held=False)
        elif self.share(data, "switch") >= ON_FROM:
            # Not again before it has come up.
            if memory[0] == 0:
                memory[0] = ON_STEPS
                self.catch(model, data, "switch", held=True)
        elif memory[0] < 0:
            memory[0] = 0
        if memory[0] == 0 and self.share(data, "switch") >= ON_FROM:
            memory[0] = -1
        self.show(data, "power", float(memory[0] > 0))
        shut = self.share(data, "lid") <= SHUT_UP_TO
        if shut and self.share(data, "lid_button") > PRESSED_FROM:
            self.catch(model, data, "lid", held=False)
        elif shut:
            self.catch(model, data, "lid", held=True)

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add base, body, spout, handle, lid and its button, switch and lamp."""
        _, depth, height = self.size
        family, finish, accent = self.record["family"], self.record["finish"], self.record["accent"]
        wide = self.width / 2
        y = depth / 2 - wide - 0.012  # the body's axis; the spout reaches the back of the box
        bottom, top = -height / 2, height / 2
        trim = "black" if finish != "black" else "graphite"
        parts.tube(root, (0, y, bottom + _BASE_M / 2), wide * 0.98, _BASE_M, trim, segments=16, bevel=0.005)
        low, rim = bottom + _BASE_M + 0.002, top - (0.048 if family == "dome" else 0.036)
        shape = {
            "cone": [(0.94, 0.0), (0.97, 0.06), (0.90, 0.45), (0.78, 0.85), (0.72, 1.0)],
            "dome": [(0.90, 0.0), (0.98, 0.15), (1.0, 0.35), (0.92, 0.65), (0.72, 0.92), (0.62, 1.0)],
            "glass": [(0.90, 0.0), (0.95, 0.05), (0.92, 0.5), (0.86, 1.0)],
        }[family]
        profile = [(wide * share, low + up * (rim - low)) for share, up in shape]
        rim_radius = profile[-1][0]
        inside = [(rim_radius - 0.006, rim), (rim_radius - 0.006, rim - 0.035), (0.0001, rim - 0.035)]
        if family == "glass":
            parts.mesh(root, meshes.turned(profile[:2], 16), (0, y, 0), finish)
            skin = [*profile[1:], *inside[:1]]
            parts.mesh(root, meshes.turned(skin, 16, caps=False), (0, y, 0), "glass")
            water = [(wide * 0.88, low + 0.012), (wide * 0.86, low + 0.45 * (rim - low))]
            parts.mesh(root, meshes.turned(water, 14), (0, y, 0), "water_cold")
            ring = [(rim_radius + 0.003, rim - 0.016), (rim_radius + 0.003, rim), *inside[:2]]
            parts.mesh(root, meshes.turned(ring, 16, caps=False), (0, y, 0), finish)
        else:
            parts.mesh(root, meshes.turned([*profile, *inside[:2]], 16, caps=False), (0, y, 0), finish)
            parts.mesh(root, meshes.disc(rim_radius - 0.004, 14), (0, y, rim - 0.034), "iron")
        for share0, share1 in ((0.0, 0.5), (0.5, 1.0)):
            z0, z1 = low + share0 * (rim - low), low + share1 * (rim - low)
            parts.stopper(root, (0, y, (z0 + z1) / 2), wide * (0.95 if share0 == 0 else 0.80), z1 - z0)
        self._add_spout(parts, root, y, rim, rim_radius)
        grip = {"chrome": "black", "oak": "oak"}.get(accent, trim)
        hinge_y = y - rim_radius - 0.004
        self._add_handle(parts, root, grip, hinge_y, y - wide * 0.95, low, rim)
        self._add_lid(parts, root, trim if family != "dome" else finish, hinge_y, y, rim, rim_radius)
        if self.record["window"] and family != "glass":
            parts.box(
                root, (wide * 0.865, y, (low + rim) / 2), (0.010, 0.016, (rim - low) * 0.5), "water_cold", collide=False
            )

    def _add_spout(self, parts: Parts, root: mujoco.MjsBody, y: float, rim: float, radius: float) -> None:
        finish = self.record["finish"] if self.record["family"] != "glass" else "silver"
        if self.record["family"] == "dome":
            path = [
                (0, y + radius, rim - 0.10),
                (0, y + radius + 0.025, rim - 0.06),
                (0, self.depth / 2 - 0.012, rim - 0.004),
            ]
            parts.pipe(root, path, 0.012, finish, sides=8)
            return
        # A wedge from the rim to the back, seen from above a triangle.
        near, far = y + radius - 0.014, self.depth / 2
        low = [[0.022, near, rim - 0.045], [0.0, near + 0.002, rim - 0.046], [-0.022, near, rim - 0.045]]
        high = [[0.022, near, rim], [0.0, far, rim + 0.002], [-0.022, near, rim]]
        parts.mesh(root, meshes.loft([np.array(low), np.array(high)]), (0, 0, 0), finish)

    def _add_handle(
        self, parts: Parts, root: mujoco.MjsBody, grip: str, hinge_y: float, foot_y: float, low: float, rim: float
    ) -> None:
        front = -self.depth / 2 + 0.011
        path = [
            (0, hinge_y + 0.012, rim - 0.004),
            (0, front + 0.016, rim - 0.004),
            (0, front, rim - 0.026),
            (0, front + 0.004, low + 0.105),
            (0, foot_y + 0.004, low + 0.080),
        ]
        parts.pipe(root, path, 0.0115, grip, sides=8, name="grip")
        # The lid's button on top of the handle, near the hinge.
        button = (0, (hinge_y + front) / 2 - 0.004, rim + 0.016)
        parts.button(root, "lid_button", button, (0.022, 0.026, 0.014), "silver", facing="top", travel=0.005, force=2.5)
        # The switch below the handle: a tab that is pushed down.
        switch_z = low + 0.034
        y = min(foot_y - 0.012, front + 0.030)
        switch = parts.slide(
            root,
            "switch",
            (0, y, switch_z),
            (0, 0, -1),
            (0.0, _SWITCH_M),
            mass=0.02,
            size=(0.03, 0.03, 0.01),
            friction=0.1,
            damping=6.0,
            armature=0.02,
        )
        parts.spring(switch, 90.0, -0.012)
        parts.hold("switch", _SWITCH_M)
        parts.box(switch, (0, -0.004, 0), (0.044, 0.036, 0.010), "light_red" if grip == "black" else "black")
        parts.box(switch, (0, (foot_y - y) / 2, 0), (0.012, abs(foot_y - y), 0.008), "black", collide=False)
        # A lamp around the foot of the body.
        radius = self.width / 2
        centre = self.depth / 2 - radius - 0.012
        lamp = parts.lamp(root, "power", (0, 0, -0.010), (0, 0, 0))
        ring_z = -self.height / 2 + _BASE_M + 0.0015
        parts.tube(lamp, (0, centre, ring_z), radius * 0.955, 0.004, "light_blue", segments=16, collide=False)

    def _add_lid(
        self, parts: Parts, root: mujoco.MjsBody, finish: str, hinge_y: float, y: float, rim: float, radius: float
    ) -> None:
        reach = y - hinge_y
        lid = parts.hinge(
            root,
            "lid",
            (0, hinge_y, rim + 0.001),
            (1, 0, 0),
            (0.0, LID_MAX),
            mass=0.04,
            size=(2 * radius, 2 * radius, 0.012),
            center=(0, reach, 0.006),
            friction=0.004,
            damping=0.045,
            armature=0.001,
        )
        # The spring opens it within a second at about 1.5 rad/s.
        parts.spring(lid, 0.022, 4.2)
        parts.hold("lid", 0.0)
        equality = parts.spec.equality(f"{self.name}_lid_hold")
        equality.active = True
        dome = 0.022 if self.record["family"] == "dome" else 0.009
        profile = [(radius + 0.002, 0.0), (radius + 0.001, 0.006), (radius * 0.55, 0.006 + dome)]
        parts.mesh(lid, meshes.turned(profile, 16), (0, reach, 0), finish)
        parts.stopper(lid, (0, reach, 0.004), radius, 0.008)
        parts.tube(lid, (0, reach, 0.012 + dome), 0.011, 0.014, "chrome", segments=8, bevel=0.003)
