"""Convex collision pieces: primitives where they fit, else the convex hull of a few points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from robocasa_lerobot.envs.objects.mesh import Array, Mesh

Vector = Sequence[float] | Array
IDENTITY = (1.0, 0.0, 0.0, 0.0)
KINDS = ("box", "cylinder", "ellipsoid", "hull")

_RING = np.column_stack([np.cos(np.arange(12) * np.pi / 6), np.sin(np.arange(12) * np.pi / 6)])


@dataclass(frozen=True)
class Solid:
    """A convex piece in the frame of its object.

    Attributes:
        kind: one of KINDS.
        size: half extents; radius and half length of a cylinder; empty for a hull.
        pos: centre, metres.
        quat: wxyz.
        points: of a hull (n, 3), metres, in the object's frame.
    """

    kind: str
    size: tuple[float, ...]
    pos: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quat: tuple[float, ...] = IDENTITY
    points: Array = field(default_factory=lambda: np.empty((0, 3)), compare=False)

    def cloud(self) -> Array:
        """Points (n, 3) whose hull is the piece, or nearly: bounds and clearances are computed from them."""
        if self.kind == "hull":
            return self.points
        if self.kind == "box":
            local = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * self.size
        elif self.kind == "cylinder":
            rim = _RING * self.size[0]
            local = np.concatenate([np.column_stack([rim, np.full(12, z * self.size[1])]) for z in (-1, 1)])
        else:
            local = _DIRECTIONS * self.size
        return np.asarray(local @ matrix(self.quat).T + np.asarray(self.pos))

    def moved(self, offset: Vector) -> Solid:
        """Translated, metres."""
        x, y, z = np.asarray(self.pos) + np.asarray(offset)
        return Solid(self.kind, self.size, (float(x), float(y), float(z)), self.quat, self.points + np.asarray(offset))

    def scaled(self, factors: Vector) -> Solid:
        """Scaled about the origin along the axes; a primitive that would no longer be one becomes a hull."""
        f = np.asarray(factors, float)
        pos = np.asarray(self.pos) * f
        where = (float(pos[0]), float(pos[1]), float(pos[2]))
        if np.allclose(f, f[0], rtol=1e-6):
            return Solid(self.kind, tuple(s * float(f[0]) for s in self.size), where, self.quat, self.points * f)
        if self.kind != "hull" and self.quat == IDENTITY:
            if self.kind in ("box", "ellipsoid"):
                return Solid(self.kind, tuple(float(s * k) for s, k in zip(self.size, f, strict=True)), where)
            if abs(f[0] - f[1]) < 1e-6:
                return Solid(self.kind, (self.size[0] * float(f[0]), self.size[1] * float(f[2])), where)
        return Solid("hull", (), points=self.cloud() * f)

    def volume(self) -> float:
        """In cubic metres; of a hull, estimated from its extents."""
        if self.kind == "box":
            return float(8 * np.prod(self.size))
        if self.kind == "cylinder":
            return float(2 * np.pi * self.size[0] ** 2 * self.size[1])
        if self.kind == "ellipsoid":
            return float(4 / 3 * np.pi * np.prod(self.size))
        return float(0.5 * np.prod(np.ptp(self.points, axis=0)))


def matrix(quat: Vector) -> Array:
    """Rotation matrix (3, 3) of a quaternion wxyz."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, np.asarray(quat, float))
    return out.reshape(3, 3)


def about(axis: str, angle: float) -> tuple[float, ...]:
    """Quaternion wxyz of a rotation about x, y or z, radians."""
    s, c = float(np.sin(angle / 2)), float(np.cos(angle / 2))
    return {"x": (c, s, 0.0, 0.0), "y": (c, 0.0, s, 0.0), "z": (c, 0.0, 0.0, s)}[axis]


def times(a: Vector, b: Vector) -> tuple[float, ...]:
    """Product of quaternions wxyz: first b, then a."""
    out = np.empty(4)
    mujoco.mju_mulQuat(out, np.asarray(a, float), np.asarray(b, float))
    return tuple(float(v) for v in out)


def _hull_directions() -> Array:
    """Directions whose farthest points stand for a shape; dense around the bottom, which it stands on."""
    rows = [(0.0, 0.0, 1.0)]
    for count, elevation in ((8, -88), (8, -45), (8, 0), (8, 45), (4, 75)):
        for k in range(count):
            turn, tilt = 2 * np.pi * (k + (elevation == 45) / 2) / count, np.radians(elevation)
            rows.append((np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), np.sin(tilt)))
    return np.array(rows)


_DIRECTIONS = _hull_directions()


def hull(shape: Mesh | Array) -> Solid:
    """The convex hull of a mesh or of points, with at most 37 corners."""
    points = shape.vertices if isinstance(shape, Mesh) else np.asarray(shape, float)
    if len(points) > len(_DIRECTIONS):
        half = np.maximum(np.ptp(points, axis=0) / 2, 1e-9)
        points = points[np.unique(np.argmax(points @ (_DIRECTIONS / half).T, axis=0))]
    return Solid("hull", (), points=np.unique(np.round(points, 6), axis=0))


def wall(bottom: float, top: float, z0: float, z1: float, thickness: float, count: int) -> list[Solid]:
    """A ring of leaning boxes: outer radii at z0 and z1, metres; the space inside them is hollow."""
    lean = float(np.arctan2(top - bottom, z1 - z0))
    middle = (top + bottom) / 2 - thickness / 2
    half_length = (z1 - z0) / 2 / float(np.cos(lean))
    half_width = max(top, bottom) * float(np.tan(np.pi / count))
    out = []
    for k in range(count):
        angle = 2 * np.pi * k / count
        pos = (middle * float(np.cos(angle)), middle * float(np.sin(angle)), (z0 + z1) / 2)
        quat = times(about("z", angle), about("y", lean))
        out.append(Solid("box", (thickness / 2, half_width, half_length), pos, quat))
    return out


def frame(width: float, depth: float, z0: float, z1: float, thickness: float) -> list[Solid]:
    """Four upright boards around a rectangle of full outer extents, metres."""
    h, z = (z1 - z0) / 2, (z0 + z1) / 2
    x, y, t = width / 2, depth / 2, thickness / 2
    return [
        *(Solid("box", (x, t, h), (0.0, s * (y - t), z)) for s in (-1.0, 1.0)),
        *(Solid("box", (t, y, h), (s * (x - t), 0.0, z)) for s in (-1.0, 1.0)),
    ]
