"""Blenders: a jug with a loose lid on a base with a button; it runs only with its lid on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Touches
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region, yaw_quat

# docs/robocasa.md, section 7.
LID_NEAR_M, LID_TILT_RAD = 0.04, float(np.radians(7.0))

_WALL_M, _PLUG_M, _FLANGE_M = 0.005, 0.016, 0.008
_KNOB_M, _KNOB_RADIUS_M = 0.036, 0.019
_SIDES = 8
_ROUND_SHARE = 0.9  # of a round jug's radius, from which on what has an origin there is outside, or is the wall's


@dataclass
class Blender(Appliance):
    """The lid is a loose body `<name>_lid` with a free joint; `button` toggles when it is let go.

    Attributes:
        with_lid: whether there is a lid in the scene at all.
    """

    with_lid: bool = True
    memory_slots: ClassVar = 1  # whether the button was touched a step ago
    looks: ClassVar = {"off": {}, "on": {"power": 1.0}}

    @property
    def regions(self) -> dict[str, Region]:
        """Inside of the jug."""
        low, top, radius = self._jug()
        round_ = self.record["jug"] == "round"
        half, across = (radius / np.sqrt(2), _ROUND_SHARE * radius) if round_ else (radius * 0.94, 0.0)
        floor = low + 0.008
        middle = (0.0, self._y(), (floor + top) / 2)
        beside = np.sqrt(3) * radius - half  # a corner of the box of a ball that just fits, however it has rolled
        beyond = (beside, beside, floor + self.height / 2)
        return {"jug": Region(self.name, middle, (half, half, (top - floor) / 2), beyond, across)}

    @property
    def lid(self) -> str:
        """Name of the lid's body."""
        return f"{self.name}_lid"

    @property
    def lid_pose(self) -> tuple[NDArray[np.float64], list[float]]:
        """Where the lid is when it is on: world position, metres, and quaternion wxyz."""
        return self.to_world((0.0, self._y(), self._jug()[1] + 0.0005)), yaw_quat(self.yaw)

    @property
    def lid_size(self) -> tuple[float, float, float]:
        """Width, depth and height of the lid; its body's origin lies `_PLUG_M` above its lowest point."""
        radius = self._jug()[2]
        return (2 * radius + 0.014, 2 * radius + 0.014, _PLUG_M + _FLANGE_M + _KNOB_M)

    def set_lid(self, data: mujoco.MjData, pos: NDArray[np.float64] | None = None, yaw: float = 0.0) -> None:
        """Put the lid on, or lay it flat so that its lowest point is at a world position; for initial states."""
        if pos is None:
            where, quat = self.lid_pose
        else:
            where, quat = np.asarray(pos) + np.array([0.0, 0.0, _PLUG_M]), yaw_quat(yaw)
        joint = data.joint(f"{self.lid}_joint0")
        joint.qpos[:], joint.qvel[:] = [*where, *quat], 0.0

    def lid_on(self, data: mujoco.MjData) -> bool:
        """Whether the lid is within 0.04 m of its place and tilted by less than 7 degrees."""
        if not self.with_lid:
            return False
        body = data.body(self.lid)
        near = float(np.linalg.norm(body.xpos - self.lid_pose[0])) < LID_NEAR_M
        return bool(near and body.xmat[8] > np.cos(LID_TILT_RAD))

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Whether it is `on`, and whether its lid is (`lid`)."""
        return {"on": self.lit(data, "power"), "lid": self.lid_on(data)}

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """Toggle when the button is let go; off without the lid."""
        memory = self.memory(data)
        pressed = self.touched(model, contacts, "button")
        on = self.lit(data, "power")
        if memory[0] and not pressed:
            on = not on
        memory[0] = pressed
        self.show(data, "power", float(on and self.lid_on(data)))

    def _y(self) -> float:
        return 0.012  # the jug stands a little behind the middle

    def _jug(self) -> tuple[float, float, float]:
        """Bottom and rim of the jug in the fixture's frame, and its inner radius (half width)."""
        lid = _FLANGE_M + _KNOB_M
        base = 0.135 if self.height > 0.385 else 0.120
        radius = min(self.width, self.depth) / 2 - 0.034
        return -self.height / 2 + base, self.height / 2 - lid, radius

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add base with button, jug with handle, and the lid."""
        width, depth, height = self.size
        finish, family = self.record["finish"], self.record["family"]
        low, top, radius = self._jug()
        y, base_h = self._y(), low + height / 2 - 0.004
        middle = (0, y * 0.5, -height / 2 + base_h / 2)
        size = (min(width, 0.18), min(depth - 0.014, 0.195), base_h)
        corner = {"jug": 0.03, "retro": 0.07, "tower": 0.018}[family]
        parts.block(
            root, middle, size, corner, finish, taper={"jug": 0.80, "retro": 0.72, "tower": 0.92}[family], bevel=0.010
        )
        parts.tube(root, (0, y, low - 0.004), radius + 0.006, 0.018, "black" if finish != "black" else "graphite")
        self._add_jug(parts, root, low, top, radius)
        # The front of the base leans back; button and panel stand out of it far enough.
        face = middle[1] - size[1] / 2 + 0.010
        z = -height / 2 + 0.046
        if self.record["panel"] == "wide":
            parts.box(root, (0, face - 0.008, z), (0.115, 0.020, 0.048), "black", collide=False)
        else:
            parts.tube(root, (0, face - 0.006, z), 0.030, 0.018, "chrome", axis="y", collide=False)
        face -= 0.018 if self.record["panel"] == "wide" else 0.015
        parts.button(root, "button", (0, face - 0.009, z), (0.036, 0.036, 0.012), "silver", round_=True)
        lamp = parts.lamp(root, "power", (0, 0.014, 0), (0, 0, 0))
        parts.tube(lamp, (0, face - 0.001, z), 0.0235, 0.003, "light_blue", axis="y", segments=14, collide=False)
        if self.with_lid:
            self._add_lid(parts, radius)

    def _add_jug(self, parts: Parts, root: mujoco.MjsBody, low: float, top: float, radius: float) -> None:
        y = self._y()
        outer = radius + _WALL_M
        square = self.record["jug"] == "square"
        if square:
            rings = [
                meshes.rounded_rectangle(2 * r, 2 * r, z, min(0.018, r))
                for r, z in ((outer * 0.86, low), (outer, top), (radius, top), (radius * 0.86, low + 0.006))
            ]
        else:
            rings = [
                meshes.circle(r, z, 14)
                for r, z in (
                    (outer * 0.80, low),
                    (outer * 0.97, low + (top - low) * 0.5),
                    (outer, top),
                    (radius, top),
                    (radius * 0.80, low + 0.006),
                )
            ]
        parts.mesh(root, meshes.loft(rings, caps=False), (0, y, 0), "glass")
        parts.tube(root, (0, y, low + 0.004), radius * 0.8, 0.008, "black", segments=10)
        for angle in (0.4, 0.4 + np.pi / 2):
            blade = parts.box(root, (0, y, low + 0.016), (0.05, 0.010, 0.003), "chrome", collide=False)
            blade.quat = yaw_quat(angle)
        # Walls that are touched: a ring of boards.
        tall = top - low
        for index in range(4 if square else _SIDES):
            count = 4 if square else _SIDES
            angle = 2 * np.pi * index / count
            along = 2 * outer * np.tan(np.pi / count)
            spot = ((radius + _WALL_M / 2) * np.cos(angle), y + (radius + _WALL_M / 2) * np.sin(angle), (low + top) / 2)
            board = parts.blocker(root, spot, (_WALL_M, along, tall))
            # `add_box` turns the geom so that its z is the thin edge; turn that about the jug's axis.
            quat = np.zeros(4)
            mujoco.mju_mulQuat(quat, np.array(yaw_quat(angle)), np.array(board.quat))
            board.quat = quat
        for share in (0.35, 0.5, 0.65, 0.8):
            parts.box(root, (0, y - outer * 0.99, low + share * tall), (0.022, 0.002, 0.002), "label", collide=False)
        grip = "black" if self.record["family"] != "retro" else "chrome"
        out = self.width / 2 - 0.010
        if self.record["handle"] == "bow":
            path = [
                (outer * 0.96, y, top - 0.02),
                (out, y, top - 0.03),
                (out, y, low + 0.06),
                (outer * 0.9, y, low + 0.035),
            ]
        else:
            path = [(outer * 0.96, y, top - 0.015), (out, y, top - 0.022), (out - 0.006, y, low + 0.05)]
        parts.pipe(root, path, 0.009, grip, sides=8)

    def _add_lid(self, parts: Parts, radius: float) -> None:
        where, quat = self.lid_pose
        body = parts.spec.worldbody.add_body(name=self.lid, pos=where.tolist(), quat=quat)
        body.add_freejoint(name=f"{self.lid}_joint0")
        body.mass = 0.12
        body.explicitinertial = True
        inertia = 0.12 * radius**2 / 4 + 2e-5
        body.inertia = [inertia, inertia, 0.12 * radius**2 / 2 + 2e-5]
        body.ipos = [0, 0, 0.004]
        flange, plug = radius + 0.007, radius - 0.006
        first = len(body.geoms)
        colour = "black" if self.record["finish"] not in ("black", "graphite") else "graphite"
        if self.record["jug"] == "square":
            parts.block(body, (0, 0, _FLANGE_M / 2), (2 * flange, 2 * flange, _FLANGE_M), 0.022, colour)
            parts.block(body, (0, 0, -_PLUG_M / 2), (2 * plug, 2 * plug, _PLUG_M), 0.018, "rubber", taper=1.0)
        else:
            parts.tube(body, (0, 0, _FLANGE_M / 2), flange, _FLANGE_M, colour, segments=14, bevel=0.003, foot=True)
            parts.tube(body, (0, 0, -_PLUG_M / 2), plug * 0.985, _PLUG_M, "rubber", segments=14, foot=True)
        parts.tube(
            body, (0, 0, _FLANGE_M + _KNOB_M / 2), _KNOB_RADIUS_M * 0.92, _KNOB_M, colour, segments=10,
            top_radius=_KNOB_RADIUS_M, bevel=0.004,
        )  # fmt: skip
        for geom in body.geoms[first:]:
            if geom.contype:
                geom.contype, geom.conaffinity = 1, 1  # as objects have
                geom.friction = [0.95, 0.3, 0.1]
