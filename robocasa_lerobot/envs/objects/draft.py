"""What a form draws into: meshes with their paint, collision pieces, and what can be put inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robocasa_lerobot.envs.objects.mesh import Array, Mesh, joined
from robocasa_lerobot.envs.objects.paint import Paint, Rgb, pack
from robocasa_lerobot.envs.objects.solids import IDENTITY, Solid, about, frame, hull, times, wall

# Shininess, specular and opacity of each finish.
FINISHES: dict[str, tuple[float, float, float]] = {
    "matte": (0.05, 0.15, 1.0),
    "satin": (0.35, 0.35, 1.0),
    "gloss": (0.75, 0.65, 1.0),
    "metal": (0.85, 0.9, 1.0),
    "glass": (0.9, 0.9, 0.34),
    "clear": (0.9, 0.9, 0.16),
    "tinted": (0.8, 0.7, 0.72),
}
_LIFT = 0.0015  # walls end above the floor's underside, so that only the floor touches the worktop


@dataclass(frozen=True)
class Interior:
    """A box that objects can be put into or onto, in the object's frame: centre and half extents, metres."""

    center: tuple[float, float, float]
    half: tuple[float, float, float]


@dataclass(frozen=True)
class Model:
    """The shape of an instance; its origin is the centre of its bounding box, z up as it stands or lies.

    Attributes:
        meshes: OBJ files by finish.
        png: the texture that they share.
        solids: collision pieces.
        interior: where it holds other objects, if it does.
        rolls: whether it needs rolling friction to stay where it is put.
        density: of the collision pieces, kg / m^3.
        triangles: of the meshes.
    """

    meshes: dict[str, bytes]
    png: bytes
    solids: tuple[Solid, ...]
    interior: Interior | None
    rolls: bool
    density: float
    triangles: int


@dataclass
class Draft:
    """A shape while it is drawn: bottom at z = 0, or anywhere: `model` brings it to its size and its origin.

    Attributes:
        size: full extents wanted, metres.
        colour: main colour.
        rng: for details.
        args: of the form, from the category's record.
        name: of the category, for labels.
        seed: of the instance.
    """

    size: tuple[float, float, float]
    colour: Rgb
    rng: np.random.Generator
    args: dict[str, Any]
    name: str
    seed: int
    rolls: bool = False
    density: float = 100.0
    parts: list[tuple[Mesh, Paint, str]] = field(default_factory=list)
    solids: list[Solid] = field(default_factory=list)
    inside: tuple[Array, Array] | None = None

    def add(self, mesh: Mesh, paint: Paint | None = None, finish: str = "matte") -> Mesh:
        """Add a mesh in a paint (default: the main colour)."""
        self.parts.append((mesh, self.colour if paint is None else paint, finish))
        return mesh

    def body(self, mesh: Mesh, paint: Paint | None = None, finish: str = "matte") -> Mesh:
        """Add a mesh that also collides, as its convex hull."""
        self.solids.append(hull(mesh))
        return self.add(mesh, paint, finish)

    def box(
        self, size: Sequence[float], center: Sequence[float] = (0, 0, 0), quat: Sequence[float] = (1, 0, 0, 0)
    ) -> None:
        """Add a collision box of full extents."""
        x, y, z = (float(s) / 2 for s in size)
        cx, cy, cz = (float(c) for c in center)
        self.solids.append(Solid("box", (x, y, z), (cx, cy, cz), tuple(float(q) for q in quat)))

    def cylinder(self, radius: float, z0: float, z1: float, x: float = 0.0, y: float = 0.0) -> None:
        """Add an upright collision cylinder."""
        self.solids.append(
            Solid("cylinder", (float(radius), float(z1 - z0) / 2), (float(x), float(y), float(z0 + z1) / 2))
        )

    def hull(self, shape: Mesh | Array) -> None:
        """Add the convex hull of a mesh or of points as a collision piece."""
        self.solids.append(hull(shape))

    def cup(self, bottom: float, top: float, z0: float, z1: float, thickness: float, count: int = 8) -> None:
        """Add a hollow round vessel: a floor and a ring of boards; outer radii."""
        self.cylinder(bottom, z0, z0 + thickness)
        self.solids.extend(wall(bottom, top, z0 + _LIFT, z1, thickness, count))
        room = min(bottom, top) - thickness
        self.holds((0, 0, (z0 + thickness + z1) / 2), (room * 0.75, room * 0.75, (z1 - z0 - thickness) / 2))

    def crate(self, width: float, depth: float, z0: float, z1: float, thickness: float) -> None:
        """Add a hollow rectangular vessel: a floor and four boards; outer extents."""
        self.box((width, depth, thickness), (0, 0, z0 + thickness / 2))
        self.solids.extend(frame(width, depth, z0 + _LIFT, z1, thickness))
        self.holds(
            (0, 0, (z0 + thickness + z1) / 2),
            (width / 2 - thickness, depth / 2 - thickness, (z1 - z0 - thickness) / 2),
        )

    def holds(self, center: Sequence[float], half: Sequence[float]) -> None:
        """Say where objects can be put."""
        self.inside = (np.asarray(center, float), np.asarray(half, float))

    def half_turn(self) -> None:
        """Turn everything by half a turn about z, so that what was drawn towards -x shows towards +x."""
        self.parts = [(mesh.turned("z", np.pi), paint, finish) for mesh, paint, finish in self.parts]
        turned = []
        for s in self.solids:
            if s.kind == "hull":
                turned.append(Solid("hull", (), points=s.points * [-1, -1, 1]))
            else:
                pos = (-s.pos[0], -s.pos[1], s.pos[2])
                turned.append(
                    Solid(s.kind, s.size, pos, s.quat if s.quat == IDENTITY else times(about("z", np.pi), s.quat))
                )
        self.solids = turned

    def model(self, minimum_mass_kg: float = 0.015) -> Model:
        """The finished shape: scaled to `size`, about the centre of its bounding box."""
        # Nothing hangs below what it stands on.
        floor = min(float(s.cloud()[:, 2].min()) for s in self.solids)
        self.parts = [(mesh.above(floor), paint, finish) for mesh, paint, finish in self.parts]
        clouds = [m.vertices for m, _, _ in self.parts] + [s.cloud() for s in self.solids]
        points = np.concatenate(clouds)
        low, high = points.min(axis=0), points.max(axis=0)
        factors = np.asarray(self.size) / np.maximum(high - low, 1e-9)
        if np.allclose(factors, 1.0, atol=2e-3):
            factors = np.ones(3)
        origin = (low + high) / 2
        solids = tuple(s.moved(-origin).scaled(factors) for s in self.solids)
        atlas = pack([paint for _, paint, _ in self.parts])
        by_finish: dict[str, list[Mesh]] = {}
        for (mesh, _, finish), (u0, v0, u1, v1) in zip(self.parts, atlas.places, strict=True):
            uv = np.array([u0, v0]) + np.clip(mesh.uv, 0, 1) * np.array([u1 - u0, v1 - v0])
            placed = Mesh((mesh.vertices - origin) * factors, mesh.faces, uv, mesh.ids)
            by_finish.setdefault(finish, []).append(placed)
        meshes = {finish: joined(members) for finish, members in by_finish.items()}
        interior = None
        if self.inside is not None:
            (cx, cy, cz), (hx, hy, hz) = (self.inside[0] - origin) * factors, self.inside[1] * factors
            interior = Interior((float(cx), float(cy), float(cz)), (float(hx), float(hy), float(hz)))
        mass = self.density * sum(s.volume() for s in solids)
        return Model(
            meshes={finish: obj_text(mesh) for finish, mesh in meshes.items()},
            png=atlas.png,
            solids=solids,
            interior=interior,
            rolls=self.rolls,
            density=self.density * max(1.0, minimum_mass_kg / mass),
            triangles=sum(len(mesh.faces) for mesh in meshes.values()),
        )


def obj_text(mesh: Mesh) -> bytes:
    """The mesh as a Wavefront OBJ file, with texture coordinates and normals, rounded to 10 micrometres."""
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"vt {u:.4f} {v:.4f}" for u, v in mesh.uv.tolist()]
    lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in mesh.normals().tolist()]
    lines += [f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


Form = Callable[[Draft], None]
FORMS: dict[str, Form] = {}


def form(function: Form) -> Form:
    """Register a form under the name of its function."""
    FORMS[function.__name__] = function
    return function
