"""Stand mixers: a head that tilts up, a lock that holds it down, a speed knob, a bowl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region, yaw_quat

# docs/robocasa.md, section 7.
LOCK_FROM, HEAD_DOWN = 0.75, 0.01
LOCK_RELEASED = 0.25  # the lock has come out
HEAD_MAX = 0.75  # radians
_BASE_M, _BOWL_SIDES = 0.030, 10


@dataclass
class StandMixer(Appliance):
    """Parts `head` (0 down, 1 up), `head_lock` (a button that stays in when pressed), `knob_speed`."""

    memory_slots: ClassVar = 2  # the lock has been let go since it was pressed; the mixer's shaft
    looks: ClassVar = {"down": {}, "up": {"head": 1.0}, "on": {"knob_speed": 0.6, "head_lock": 1.0, "power": 1.0}}

    @property
    def regions(self) -> dict[str, Region]:
        """Inside of the bowl."""
        (_, y, z), radius, tall = self._bowl()
        half = radius / np.sqrt(2)
        return {"bowl": Region(self.name, (0.0, y, z + 0.012 + (tall - 0.012) / 2), (half, half, (tall - 0.012) / 2))}

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of `head`, `head_lock` and `speed`, whether the lock is `locked`, and `on`."""
        lock = self.share(data, "head_lock")
        return {
            "head": self.share(data, "head"),
            "head_lock": lock,
            "locked": lock > LOCK_FROM,
            "speed": self.share(data, "knob_speed"),
            "on": self.lit(data, "power"),
        }

    def set_head(self, data: mujoco.MjData, share: float) -> None:
        """Tilt the head by a share of its range; for initial states."""
        self.set_share(data, "head", share)

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """The lock stays in when pressed, comes out when pressed again, and holds a head that is down."""
        memory = self.memory(data)
        held = bool(data.eq_active[model.equality(f"{self.name}_head_lock_hold").id])
        touched = self.touched(model, contacts, "head_lock")
        if not held and self.share(data, "head_lock") > LOCK_FROM:
            # After it has come out it must come up before it latches again.
            if memory[0] != 2:
                self.catch(model, data, "head_lock", held=True)
                held, memory[0] = True, 0
        elif held and not touched:
            memory[0] = 1
        elif held and memory[0] == 1:
            self.catch(model, data, "head_lock", held=False)
            held, memory[0] = False, 2
        elif not held and not touched and self.share(data, "head_lock") < LOCK_RELEASED:
            memory[0] = 0
        self.catch(model, data, "head", held=held and self.share(data, "head") <= HEAD_DOWN)
        self.show(data, "power", float(self.share(data, "knob_speed") > 0.02))

    def _column_y(self) -> float:
        return self.depth / 2 - 0.060

    def _bowl(self) -> tuple[tuple[float, float, float], float, float]:
        """Middle of the bowl's foot, its inner radius at the rim, and its height."""
        radius = min(self.width / 2 - 0.008, (self.depth - 0.12) / 2 - 0.006)
        return (0.0, -self.depth / 2 + radius + 0.008, -self.height / 2 + _BASE_M), radius - 0.004, 0.135

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add base, column, bowl, controls and head."""
        width, depth, height = self.size
        finish, angular = self.record["finish"], self.record["family"] == "angular"
        bottom, y = -height / 2, self._column_y()
        corner = 0.02 if angular else 0.055
        parts.block(
            root, (0, 0.004, bottom + _BASE_M / 2), (width * 0.86, depth - 0.012, _BASE_M), corner, finish, bevel=0.008
        )
        head_z = -height / 2 + height * 0.62
        column_h = head_z - bottom
        parts.block(
            root, (0, y, bottom + column_h / 2), (width * 0.46, 0.110, column_h), corner * 0.7, finish,
            taper=0.9 if angular else 0.82, bevel=0.006,
        )  # fmt: skip
        self._add_bowl(parts, root)
        side = width * 0.46 / 2 * 0.96
        z = bottom + column_h * 0.62
        parts.tube(root, (side, y + 0.020, z), 0.026, 0.010, "chrome", axis="x", collide=False)
        parts.knob(
            root, "knob_speed", (side + 0.004, y + 0.020, z), 0.021, "black", "white", facing="right",
            limits=(0.0, np.pi), length=0.026,
        )  # fmt: skip
        lock_z = bottom + column_h * 0.82
        parts.tube(root, (side, y - 0.022, lock_z), 0.015, 0.012, "chrome", axis="x", segments=10, collide=False)
        lock = parts.button(
            root, "head_lock", (side + 0.017, y - 0.022, lock_z), (0.022, 0.022, 0.014), "light_red", facing="right",
            round_=True, travel=0.006, force=3.0,
        )  # fmt: skip
        assert lock is not None
        parts.hold("head_lock", 0.006)
        lamp = parts.lamp(root, "power", (-0.012, 0, 0), (0, 0, 0))
        parts.tube(
            lamp, (side + 0.004, y + 0.020, z + 0.036), 0.006, 0.006, "light_green", axis="x", segments=8, collide=False
        )
        self._add_head(parts, root, head_z)

    def _add_bowl(self, parts: Parts, root: mujoco.MjsBody) -> None:
        (x, y, z), radius, tall = self._bowl()
        finish = self.record["bowl"]
        wall = 0.004
        outer = [(radius * 0.48, 0.0), (radius * 0.52, 0.012), (radius * 0.86, tall * 0.42), (radius + wall, tall)]
        inner = [(radius, tall), (radius * 0.84, tall * 0.44), (radius * 0.48, 0.018), (0.0005, 0.012)]
        parts.mesh(root, meshes.turned([*outer, *inner], 16, caps=False), (x, y, z), finish)
        parts.stopper(root, (x, y, z + 0.007), radius * 0.55, 0.014)
        # A ring of boards that lean outwards as the wall does.
        for low, high in ((0, 1), (1, 2)):
            points = [(radius * 0.50, 0.012), (radius * 0.86, tall * 0.43), (radius + wall / 2, tall)]
            (r0, z0), (r1, z1) = points[low], points[high]
            lean, long = np.arctan2(r1 - r0, z1 - z0), float(np.hypot(r1 - r0, z1 - z0))
            for index in range(_BOWL_SIDES):
                angle = 2 * np.pi * index / _BOWL_SIDES
                middle = (r0 + r1) / 2 + wall / 2
                spot = (x + middle * np.cos(angle), y + middle * np.sin(angle), z + (z0 + z1) / 2)
                board = parts.blocker(root, spot, (wall, 2.1 * r1 * np.tan(np.pi / _BOWL_SIDES), long))
                quat, tilted = np.zeros(4), np.zeros(4)
                mujoco.mju_mulQuat(tilted, np.array([np.cos(lean / 2), 0, np.sin(lean / 2), 0]), np.array(board.quat))
                mujoco.mju_mulQuat(quat, np.array(yaw_quat(angle)), tilted)
                board.quat = quat

    def _add_head(self, parts: Parts, root: mujoco.MjsBody, z: float) -> None:
        width, depth, height = self.size
        finish, angular = self.record["finish"], self.record["family"] == "angular"
        y = self._column_y()
        head_h = height / 2 - z
        long = y + 0.05 + depth / 2 - 0.008
        head = parts.hinge(
            root,
            "head",
            (0, y + 0.020, z),
            (-1, 0, 0),
            (0.0, HEAD_MAX),
            mass=0.7,
            size=(width * 0.5, long, head_h),
            center=(0, 0.03 - long / 2, head_h / 2),
            friction=1.3,
            damping=0.4,
            armature=0.02,
        )
        parts.hold("head", 0.0)
        # Along y: a loft of rings from the back to the nose.
        wide = width * 0.52
        shape: tuple[tuple[float, float], ...]
        shape = ((0.0, 0.62), (0.06, 0.86), (0.30, 1.0), (0.72, 0.98), (0.93, 0.82), (1.0, 0.55))
        if angular:
            shape = ((0.0, 0.86), (0.05, 0.96), (0.5, 1.0), (0.95, 0.96), (1.0, 0.84))
        rings = []
        for along, share in shape:
            ring = meshes.rounded_rectangle(
                wide * share, head_h * (0.55 + 0.45 * share), 0, 0.018 if angular else 0.045
            )
            # Ring points (x, up) at their distance to the front, wound to be seen from outside.
            rings.append(
                np.stack([ring[:, 0], np.full(len(ring), 0.03 - along * long), ring[:, 1] + head_h / 2 + 0.002], axis=1)
            )
        parts.mesh(head, meshes.loft(rings), (0, 0, 0), finish)
        parts.blocker(head, (0, 0.03 - long / 2, head_h / 2 + 0.002), (wide * 0.96, long * 0.96, head_h * 0.94))
        (_, bowl_y, bowl_z), _, tall = self._bowl()
        nose_y = bowl_y - (y + 0.020)
        if self.record["trim"] == "band":
            parts.box(
                head, (0, 0.03 - long * 0.5, head_h * 0.42), (wide * 1.01, long * 0.42, 0.012), "chrome", collide=False
            )
        parts.tube(head, (0, 0.03 - long - 0.002, head_h * 0.55), 0.022, 0.012, "chrome", axis="y", bevel=0.003)
        parts.tube(head, (0, nose_y, -0.006), 0.034, 0.020, "chrome", collide=False, foot=True)
        reach = z - (bowl_z + tall) + 0.075
        parts.tube(head, (0, nose_y, -reach * 0.35), 0.007, reach * 0.7, "chrome", segments=8, collide=False)
        tool_z = -reach * 0.62
        if self.record["tool"] == "whisk":
            profile = [(0.004, -0.052), (0.022, -0.040), (0.028, -0.020), (0.020, 0.010), (0.006, 0.040)]
            parts.mesh(head, meshes.turned(profile, 8), (0, nose_y, tool_z), "wire")
        elif self.record["tool"] == "paddle":
            parts.box(head, (0, nose_y, tool_z - 0.006), (0.060, 0.006, 0.075), "wire", collide=False)
        else:
            hook = [
                (0, nose_y, tool_z + 0.03),
                (0.024, nose_y, tool_z),
                (0.0, nose_y - 0.018, tool_z - 0.03),
                (-0.02, nose_y, tool_z - 0.045),
            ]
            parts.pipe(head, hook, 0.007, "wire", collide=False)
