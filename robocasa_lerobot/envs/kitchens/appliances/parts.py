"""The parts that appliances are assembled from: doors, racks, knobs, buttons, handles, lamps."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.shapes import Shapes
from robocasa_lerobot.envs.kitchens.fixtures import base
from robocasa_lerobot.envs.kitchens.fixtures.base import Vector

# Clearance behind a handle for a finger of the gripper, metres.
HANDLE_STANDOFF_M = 0.045
HANDLE_RADIUS_M = 0.008
# A part too long to hide in its appliance, such as running water, waits this far below the floor, metres.
HIDDEN_M = 3.0

# Of what faces a side: outwards, upwards as an observer there sees it, and the axis name of its round parts.
_FACINGS: dict[str, tuple[NDArray[np.float64], NDArray[np.float64], str]] = {
    "front": (np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0]), "y"),
    "top": (np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), "z"),
    "right": (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), "x"),
}
_HINGE, _SLIDE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE


class Parts(Shapes):
    """Adds moving parts and handles to a spec under an appliance's name, with the finishes of its split."""

    def hinge(
        self,
        parent: mujoco.MjsBody,
        part: str,
        pos: Vector,
        axis: Vector,
        limits: tuple[float, float],
        *,
        mass: float,
        size: Vector,
        center: Vector = (0.0, 0.0, 0.0),
        friction: float = 0.5,
        damping: float = 0.5,
        armature: float = 0.01,
    ) -> mujoco.MjsBody:
        """A body on a hinge; the joint is `<appliance>_<part>_joint`. Radians, Nm."""
        return self._moving(parent, part, _HINGE, pos, axis, limits, mass, size, center, friction, damping, armature)

    def slide(
        self,
        parent: mujoco.MjsBody,
        part: str,
        pos: Vector,
        axis: Vector,
        limits: tuple[float, float],
        *,
        mass: float,
        size: Vector,
        center: Vector = (0.0, 0.0, 0.0),
        friction: float = 0.5,
        damping: float = 5.0,
        armature: float = 0.01,
    ) -> mujoco.MjsBody:
        """A body on a slide; the joint is `<appliance>_<part>_joint`. Metres, N."""
        return self._moving(parent, part, _SLIDE, pos, axis, limits, mass, size, center, friction, damping, armature)

    def _moving(
        self,
        parent: mujoco.MjsBody,
        part: str,
        kind: mujoco.mjtJoint,
        pos: Vector,
        axis: Vector,
        limits: tuple[float, float],
        mass: float,
        size: Vector,
        center: Vector,
        friction: float,
        damping: float,
        armature: float,
    ) -> mujoco.MjsBody:
        body = parent.add_body(name=f"{self.name}_{part}", pos=list(pos))
        body.add_joint(
            name=f"{self.name}_{part}_joint",
            type=kind,
            axis=list(axis),
            range=list(limits),
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            damping=[damping],
            frictionloss=friction,
            armature=armature,
            # Dry friction that does not creep: doors stay where they are left.
            solref_friction=[0.004, 1.0],
            solimp_friction=[0.998, 0.9999, 0.001, 0.5, 2.0],
            solref_limit=[0.006, 1.0],
            solimp_limit=[0.98, 0.999, 0.001, 0.5, 2.0],
        )
        base.set_inertia(body, mass, size, center)
        return body

    def spring(self, body: mujoco.MjsBody, stiffness: float, rest: float) -> None:
        """A spring on a part's joint, N/m or Nm/rad; `rest` is the joint's position without force."""
        body.joints[0].stiffness = [stiffness, 0, 0]
        body.joints[0].springref = rest

    def knob(
        self,
        parent: mujoco.MjsBody,
        part: str,
        pos: Vector,
        radius: float,
        finish: str,
        pointer: str,
        *,
        limits: tuple[float, float] = (0.0, 1.5 * np.pi),
        length: float = 0.026,
        facing: str = "front",
        style: str = "round",
    ) -> mujoco.MjsBody:
        """A knob that turns clockwise for an observer whom it faces ("front", "top" or "right"); friction holds it.

        `style` is "round" or "bar", a disc with a grip across it. A pointer shows where it stands.
        """
        out, up, turn = _FACINGS[facing]
        body = self.hinge(
            parent,
            part,
            pos,
            -out,
            limits,
            mass=0.04,
            size=(2 * radius, length, 2 * radius),
            friction=0.04,
            damping=0.01,
            armature=0.0005,
        )
        if style == "bar":
            self.tube(body, out * 0.004, radius, 0.008, finish, axis=turn, collide=False)
            size = np.abs(out) * length + np.abs(up) * 2 * radius
            size[size == 0] = radius * 0.55
            self.box(body, out * length / 2, size, finish)
        else:
            self.tube(body, out * length / 2, radius, length, finish, axis=turn, bevel=0.004, top_radius=radius * 0.88)
        mark = np.abs(out) * 0.002 + np.abs(up) * radius * 0.9
        mark[mark == 0] = 0.004
        self.box(body, out * (length + 0.0008) + up * radius * 0.42, mark, pointer, collide=False)
        return body

    def button(
        self,
        parent: mujoco.MjsBody,
        part: str,
        pos: Vector,
        size: Vector,
        finish: str,
        *,
        facing: str = "front",
        travel: float = 0.004,
        force: float = 2.0,
        round_: bool = False,
    ) -> mujoco.MjsBody:
        """A button that springs back; `pos` is the middle of its outer face at rest, `force` what presses it fully.

        `size` is across, then up (or away, for a button that is pressed from above), then how far it stands out.
        """
        out, up, turn = _FACINGS[facing]
        body = self.slide(
            parent,
            part,
            pos,
            -out,
            (0.0, travel),
            mass=0.01,
            size=(0.02, 0.02, 0.02),
            friction=0.02,
            damping=3.0,
            armature=0.005,
        )
        stiffness = force / (1.25 * travel)
        self.spring(body, stiffness, -0.25 * travel)
        across, high, deep = size
        if round_:
            self.tube(body, -out * deep / 2, across / 2, deep, finish, axis=turn, bevel=min(0.003, deep / 2))
        else:
            full = np.abs(out) * deep + np.abs(up) * high
            full[full == 0] = across
            self.box(body, -out * deep / 2, full, finish)
        return body

    def lamp(
        self,
        parent: mujoco.MjsBody,
        part: str,
        hidden: Vector,
        shown: Vector,
    ) -> mujoco.MjsBody:
        """A body that is seen while something is on: a slide moves it from a hidden place to where it shows.

        That something is on is thus part of the joint positions, which recordings keep. Geoms are added by the
        caller; the joint is `<appliance>_<part>_joint`. Nothing but the appliance's update moves it.
        """
        start, travel = np.asarray(hidden, dtype=np.float64), np.asarray(shown) - np.asarray(hidden)
        length = float(np.linalg.norm(travel))
        return self.slide(
            parent,
            part,
            start,
            travel / length,
            (0.0, length),
            mass=0.001,
            size=(0.01, 0.01, 0.01),
            friction=5.0,
            damping=1.0,
            armature=0.1,
        )

    def hold(self, part: str, at: float) -> None:
        """A catch that can hold a part's joint at a position; `<appliance>_<part>_hold`, open at first."""
        equality = self.spec.add_equality(
            name=f"{self.name}_{part}_hold", type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT
        )
        equality.name1 = f"{self.name}_{part}_joint"
        equality.data[0] = at
        equality.solref = [0.004, 1.0]
        equality.solimp = [0.99, 0.999, 0.001, 0.5, 2.0]
        equality.active = False

    def handle(
        self,
        body: mujoco.MjsBody,
        center: Vector,
        length: float,
        finish: str,
        *,
        axis: str,
        name: str,
        style: str = "bar",
    ) -> None:
        """A handle on a front, its middle on the panel at `center`: "bar", "slim" (flat) or "bow" (bent).

        Along "x" or "z"; the clearance behind it is at least 35 mm.
        """
        x, y, z = center
        along = np.array([1.0, 0.0, 0.0]) if axis == "x" else np.array([0.0, 0.0, 1.0])
        foot, out = np.array([x, y, z]), np.array([0.0, -HANDLE_STANDOFF_M, 0.0])
        if style == "bow":
            path = [
                foot - along * length / 2,
                foot - along * length * 0.42 + out * 0.8,
                foot - along * length * 0.22 + out,
                foot + along * length * 0.22 + out,
                foot + along * length * 0.42 + out * 0.8,
                foot + along * length / 2,
            ]
            self.pipe(body, path, HANDLE_RADIUS_M, finish, name=name)
            return
        if style == "slim":
            size = along * length + np.array([0.0, 0.011, 0.0])
            size[2 if axis == "x" else 0] = 0.022
            self.box(body, foot + out, size, finish, name=f"{name}_0")
        else:
            self.pipe(
                body, [foot + out - along * length / 2, foot + out + along * length / 2], HANDLE_RADIUS_M, finish,
                sides=8, name=name,
            )  # fmt: skip
        for side in (-1, 1):
            post = foot + side * along * (length / 2 - 0.02)
            size = np.full(3, 0.014)
            size[1] = HANDLE_STANDOFF_M
            self.box(body, post + out / 2, size, finish)

    def pane(
        self,
        body: mujoco.MjsBody,
        low: Vector,
        high: Vector,
        finish: str,
        margins: tuple[float, float, float, float],
        glass: str = "smoked_glass",
    ) -> None:
        """A door from one corner to the other with a window; `margins` are those left, right, below and above it."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        left, right, below, above = margins
        self.span(body, (x0, y0, z0), (x0 + left, y1, z1), finish)
        self.span(body, (x1 - right, y0, z0), (x1, y1, z1), finish)
        self.span(body, (x0 + left, y0, z0), (x1 - right, y1, z0 + below), finish)
        self.span(body, (x0 + left, y0, z1 - above), (x1 - right, y1, z1), finish)
        middle, half = (y0 + y1) / 2, (y1 - y0) * 0.3
        self.span(body, (x0 + left, middle - half, z0 + below), (x1 - right, middle + half, z1 - above), glass)

    def wire_rack(
        self, body: mujoco.MjsBody, size: Vector, finish: str, *, bars: int = 7, rim: float = 0.0, name: str = "rack"
    ) -> None:
        """A wire shelf, its top at the body's origin: bars from front to back in a frame; touched as a thin plate.

        `rim` is the height of a fence around it, with a rail at the front to pull it by.
        """
        width, depth, _ = size
        wire = 0.005
        self.blocker(body, (0, 0, -wire / 2), (width, depth, wire), name=name)
        for x in np.linspace(-width / 2 + wire, width / 2 - wire, bars):
            self.box(body, (float(x), 0, -wire / 2), (wire * 0.7, depth, wire), finish, collide=False)
        for level in {0.0, rim}:
            for side in (-1, 1):
                self.box(body, (0, side * (depth - wire) / 2, level), (width, wire, wire), finish, collide=rim > 0)
                self.box(body, (side * (width - wire) / 2, 0, level), (wire, depth, wire), finish, collide=rim > 0)
        if rim > 0:
            for x in (-0.5, -0.17, 0.17, 0.5):
                for side in (-1, 1):
                    post = (x * (width - wire), side * (depth - wire) / 2, rim / 2)
                    self.box(body, post, (wire, wire, rim), finish, collide=False)
