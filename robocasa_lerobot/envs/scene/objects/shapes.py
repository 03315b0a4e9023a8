"""Shapes of objects from primitives: what a category looks like, and convex collision geometry that rests stably.

The body origin of an object is the centre of its bounding box; z is up as it lies or stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.envs.scene.fixtures.base import AXIS_QUATS, VISUAL_GROUP, Vector
from robocasa_lerobot.envs.scene.materials import MaterialPalette
from robocasa_lerobot.envs.scene.objects.catalogue import Instance, Rgba

# Contact parameters of objects (robocasa facts, section 6); torsional friction keeps them from spinning in a grasp.
FRICTION = (0.95, 0.3, 0.1)
SOLIMP, SOLREF = (0.998, 0.998, 0.001, 0.5, 2.0), (0.004, 2.0)
DENSITY = 100.0  # kg / m^3

_Geom = mujoco.mjtGeom


@dataclass
class Builder:
    """Adds geoms of one object to its body."""

    body: mujoco.MjsBody
    palette: MaterialPalette
    name: str
    count: int = 0

    def add(
        self,
        kind: mujoco.mjtGeom,
        size: Vector,
        rgba: Rgba,
        pos: Vector = (0, 0, 0),
        quat: Vector = (1, 0, 0, 0),
        *,
        collide: bool = True,
        shininess: float = 0.3,
        rolls: bool = False,
    ) -> None:
        """Add a geom; `size` as MuJoCo wants it (half extents or radius and half length), metres."""
        padded = [*size, 0.0, 0.0][:3]
        material = self.palette.plain(rgba, shininess)
        geom = self.body.add_geom(type=kind, size=padded, pos=list(pos), quat=list(quat), material=material)
        geom.name = f"{self.name}_g{self.count}"
        self.count += 1
        geom.group = VISUAL_GROUP
        geom.density = DENSITY
        geom.friction = list(FRICTION)
        geom.solimp, geom.solref = list(SOLIMP), list(SOLREF)
        # Rolling friction only where something would roll off a worktop.
        geom.condim = 6 if rolls else 4
        if rolls:
            geom.friction = [FRICTION[0], 0.05, 0.004]
        if not collide:
            geom.contype = geom.conaffinity = 0
            geom.density = 0.0


def shade(rgba: Rgba, factor: float) -> Rgba:
    """The colour made lighter or darker."""
    r, g, b = (float(np.clip(c * factor, 0, 1)) for c in rgba[:3])
    return (r, g, b, 1.0)


def _round(b: Builder, item: Instance) -> None:
    half = [s / 2 for s in item.size]
    b.add(_Geom.mjGEOM_ELLIPSOID, half, item.rgba, shininess=0.5, rolls=True)
    b.add(_Geom.mjGEOM_CYLINDER, (0.002, 0.006), (0.30, 0.22, 0.10, 1.0), (0, 0, half[2] + 0.004), collide=False)


def _oval(b: Builder, item: Instance) -> None:
    b.add(_Geom.mjGEOM_ELLIPSOID, [s / 2 for s in item.size], item.rgba, rolls=True)


def _rod(b: Builder, item: Instance) -> None:
    length, width, _ = item.size
    radius = width / 2
    b.add(_Geom.mjGEOM_CAPSULE, (radius, length / 2 - radius), item.rgba, quat=AXIS_QUATS["x"], rolls=True)
    tip = (0.35, 0.50, 0.20, 1.0) if item.category.name == "carrot" else shade(item.rgba, 0.75)
    b.add(_Geom.mjGEOM_SPHERE, (radius * 0.5,), tip, (length / 2 - radius * 0.3, 0, 0), collide=False)


def _block(b: Builder, item: Instance) -> None:
    half = [s / 2 for s in item.size]
    b.add(_Geom.mjGEOM_BOX, half, item.rgba)
    b.add(
        _Geom.mjGEOM_BOX, (half[0] * 0.7, half[1] * 0.6, 0.001), shade(item.rgba, 0.9), (0, 0, half[2]), collide=False
    )


def _sponge(b: Builder, item: Instance) -> None:
    half = [s / 2 for s in item.size]
    b.add(_Geom.mjGEOM_BOX, half, item.rgba, shininess=0.0)
    pad = (half[0] * 1.002, half[1] * 1.002, half[2] * 0.22)
    b.add(_Geom.mjGEOM_BOX, pad, (0.16, 0.40, 0.24, 1.0), (0, 0, half[2] * 0.78), collide=False, shininess=0.0)


def _can(b: Builder, item: Instance) -> None:
    radius, half = item.size[0] / 2, item.size[2] / 2
    b.add(_Geom.mjGEOM_CYLINDER, (radius, half), item.rgba, shininess=0.7)
    steel: Rgba = (0.80, 0.81, 0.83, 1.0)
    for side in (-1, 1):
        b.add(_Geom.mjGEOM_CYLINDER, (radius * 0.93, 0.001), steel, (0, 0, side * half), collide=False, shininess=0.8)
    band = (radius * 1.004, half * 0.18)
    b.add(_Geom.mjGEOM_CYLINDER, band, (0.95, 0.94, 0.90, 1.0), (0, 0, half * 0.2), collide=False)


def _vessel(b: Builder, item: Instance) -> None:
    """Hollow: a floor and a ring of wall panels that flares a little upwards."""
    width, _, height = item.size
    panels, wall = 12, 0.0025
    top, bottom = width / 2 - wall, width / 2 * (0.55 if item.category.name == "bowl" else 0.82)
    lean = np.arctan2(top - bottom, height)
    middle = (top + bottom) / 2
    b.add(_Geom.mjGEOM_CYLINDER, (bottom, 0.003), item.rgba, (0, 0, -height / 2 + 0.003), shininess=0.6)
    for index in range(panels):
        angle = 2 * np.pi * index / panels
        half_width = middle * np.tan(np.pi / panels) * 1.08
        turn = _multiply(_about("z", angle), _about("y", lean))
        position = (middle * np.cos(angle), middle * np.sin(angle), 0.0)
        b.add(_Geom.mjGEOM_BOX, (wall, half_width, height / 2 / np.cos(lean)), item.rgba, position, turn, shininess=0.6)


def _carton(b: Builder, item: Instance) -> None:
    half = [s / 2 for s in item.size]
    rng = np.random.default_rng(item.seed)
    b.add(_Geom.mjGEOM_BOX, half, item.rgba)
    label: Rgba = (0.95, 0.93, 0.86, 1.0)
    for side in (-1, 1):
        position = (0, side * half[1], half[2] * float(rng.uniform(-0.1, 0.3)))
        b.add(_Geom.mjGEOM_BOX, (half[0] * 0.8, 0.001, half[2] * 0.35), label, position, collide=False)
    b.add(
        _Geom.mjGEOM_BOX,
        (half[0], half[1], half[2] * 0.08),
        shade(item.rgba, 0.7),
        (0, 0, half[2] * 0.93),
        collide=False,
    )


def _handle_and_head(b: Builder, item: Instance, head_share: float, handle_rgba: Rgba) -> tuple[float, float]:
    """A handle along x towards -x; returns centre and half length of the room left for the head."""
    length, _, height = item.size
    head = length * head_share
    grip = length - head
    b.add(_Geom.mjGEOM_BOX, (grip / 2, 0.008, height / 2 * 0.8), handle_rgba, (-head / 2, 0, 0))
    return length / 2 - head / 2, head / 2


def _spoon(b: Builder, item: Instance) -> None:
    centre, half = _handle_and_head(b, item, 0.34, item.rgba)
    b.add(
        _Geom.mjGEOM_ELLIPSOID,
        (half * 1.1, item.size[1] / 2, item.size[2] / 2),
        item.rgba,
        (centre, 0, 0),
        shininess=0.8,
    )


def _fork(b: Builder, item: Instance) -> None:
    centre, half = _handle_and_head(b, item, 0.36, item.rgba)
    b.add(
        _Geom.mjGEOM_BOX, (half * 0.4, item.size[1] / 2, 0.003), item.rgba, (centre - half * 0.6, 0, 0), shininess=0.8
    )
    for tine in (-1.0, -0.33, 0.33, 1.0):
        y = tine * (item.size[1] / 2 - 0.002)
        b.add(_Geom.mjGEOM_BOX, (half * 0.6, 0.002, 0.002), item.rgba, (centre + half * 0.4, y, 0), shininess=0.8)


def _knife(b: Builder, item: Instance) -> None:
    centre, half = _handle_and_head(b, item, 0.58, (0.14, 0.12, 0.11, 1.0))
    b.add(_Geom.mjGEOM_BOX, (half, item.size[1] / 2, 0.0025), item.rgba, (centre, 0, 0), shininess=0.9)


def _spatula(b: Builder, item: Instance) -> None:
    centre, half = _handle_and_head(b, item, 0.32, shade(item.rgba, 0.8))
    b.add(_Geom.mjGEOM_BOX, (half, item.size[1] / 2, 0.004), item.rgba, (centre, 0, 0))


SHAPES: dict[str, Callable[[Builder, Instance], None]] = {
    "round": _round,
    "oval": _oval,
    "rod": _rod,
    "block": _block,
    "sponge": _sponge,
    "can": _can,
    "vessel": _vessel,
    "carton": _carton,
    "spoon": _spoon,
    "fork": _fork,
    "knife": _knife,
    "spatula": _spatula,
}


def add_object(spec: mujoco.MjSpec, palette: MaterialPalette, name: str, item: Instance) -> None:
    """Add a free body `name` (joint `<name>_joint0`) with an instance's geoms, at the world origin."""
    body = spec.worldbody.add_body(name=name)
    body.add_freejoint(name=f"{name}_joint0")
    SHAPES[item.category.shape](Builder(body, palette, name), item)


def _about(axis: str, angle: float) -> tuple[float, float, float, float]:
    s, c = float(np.sin(angle / 2)), float(np.cos(angle / 2))
    return {"x": (c, s, 0.0, 0.0), "y": (c, 0.0, s, 0.0), "z": (c, 0.0, 0.0, s)}[axis]


def _multiply(a: Vector, b: Vector) -> tuple[float, ...]:
    out = np.empty(4)
    mujoco.mju_mulQuat(out, np.asarray(a, float), np.asarray(b, float))
    return tuple(float(v) for v in out)
