"""Visual and collision shapes of an appliance: boxes, blocks, tubes, pipes, shells.

Round shapes are seen as generated meshes and touched as simple shapes that cameras do not show.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances import meshes
from robocasa_lerobot.envs.kitchens.appliances.finishes import add_finish
from robocasa_lerobot.envs.kitchens.appliances.meshes import Mesh
from robocasa_lerobot.envs.kitchens.fixtures import base
from robocasa_lerobot.envs.kitchens.fixtures.base import AXIS_QUATS, Vector
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette

COLLISION_GROUP = 0


class Shapes:
    """Adds shapes to a spec under an appliance's name, with the finishes of its split."""

    def __init__(self, spec: mujoco.MjSpec, palette: MaterialPalette, name: str, split: str) -> None:
        self.spec, self.palette, self.name, self.split = spec, palette, name, split

    def material(self, finish: str) -> str:
        """Name of a finish's material."""
        return add_finish(self.palette, finish, self.split)

    def box(
        self, body: mujoco.MjsBody, center: Vector, size: Vector, finish: str, *, name: str = "", collide: bool = True
    ) -> mujoco.MjsGeom:
        """A box of full edge lengths."""
        geom = base.add_box(body, center, size, self.material(finish), collide=collide)
        if name:
            geom.name = f"{self.name}_{name}"
        return geom

    def blocker(self, body: mujoco.MjsBody, center: Vector, size: Vector, *, name: str = "") -> mujoco.MjsGeom:
        """A box that is only touched."""
        geom = self.box(body, center, size, "black", name=name)
        geom.group = COLLISION_GROUP
        return geom

    def stopper(
        self, body: mujoco.MjsBody, center: Vector, radius: float, length: float, *, axis: str = "z"
    ) -> mujoco.MjsGeom:
        """A cylinder that is only touched."""
        geom = base.add_cylinder(body, center, radius, length, self.material("black"), axis=axis)
        geom.group = COLLISION_GROUP
        return geom

    def mesh(self, body: mujoco.MjsBody, mesh: Mesh, center: Vector, finish: str, *, axis: str = "z") -> mujoco.MjsGeom:
        """A mesh that is only seen; equal meshes of a scene are stored once."""
        key = f"mesh_{mesh.digest}"
        if self.spec.mesh(key) is None:
            asset = self.spec.add_mesh(name=key)
            asset.uservert = mesh.vertices.ravel().tolist()
            asset.userface = mesh.faces.ravel().tolist()
            asset.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        geom = body.add_geom()
        geom.type, geom.meshname, geom.pos, geom.quat = mujoco.mjtGeom.mjGEOM_MESH, key, center, AXIS_QUATS[axis]
        geom.material, geom.group = self.material(finish), base.VISUAL_GROUP
        geom.contype = geom.conaffinity = 0
        geom.mass = 0.0
        return geom

    def block(
        self,
        body: mujoco.MjsBody,
        center: Vector,
        size: Vector,
        radius: float,
        finish: str,
        *,
        bevel: float = 0.004,
        taper: float = 1.0,
        per_corner: int = 3,
        collide: bool = True,
    ) -> None:
        """A box with rounded upright edges, touched as a box."""
        self.mesh(body, meshes.block(size, radius, bevel=bevel, taper=taper, per_corner=per_corner), center, finish)
        if collide:
            self.blocker(body, center, size)

    def tube(
        self,
        body: mujoco.MjsBody,
        center: Vector,
        radius: float,
        length: float,
        finish: str,
        *,
        axis: str = "z",
        segments: int | None = None,
        bevel: float = 0.0,
        top_radius: float | None = None,
        collide: bool = True,
        foot: bool = False,
    ) -> None:
        """A round bar, disc or cone about an axis; `bevel` breaks its upper edge, `foot` closes its lower end."""
        top = radius if top_radius is None else top_radius
        profile = [(radius, -length / 2), (top, length / 2 - bevel)]
        if bevel > 0:
            profile.append((top - bevel, length / 2))
        # Along y the mesh's upper end must look at the person in front, who stands at -y: AXIS_QUATS turns z to -y.
        self.mesh(
            body,
            meshes.turned(profile, segments or (10 if radius < 0.03 else 14), foot=foot),
            center,
            finish,
            axis=axis,
        )
        if collide:
            self.stopper(body, center, max(radius, top), length, axis=axis)

    def pipe(
        self,
        body: mujoco.MjsBody,
        path: Sequence[Vector],
        radius: float,
        finish: str,
        *,
        sides: int = 6,
        name: str = "",
        collide: bool = True,
    ) -> None:
        """A bent round bar, touched as capsules; with a name these are `<name>_0`, `<name>_1`, ..."""
        self.mesh(body, meshes.pipe([list(p) for p in path], radius, sides), (0, 0, 0), finish)
        if not collide:
            return
        for index, (start, end) in enumerate(itertools.pairwise(path)):
            geom = base.add_capsule(body, start, end, radius, self.material(finish))
            geom.group = COLLISION_GROUP
            if name:
                geom.name = f"{self.name}_{name}_{index}"

    def shell(
        self,
        body: mujoco.MjsBody,
        low: Vector,
        high: Vector,
        wall: float | dict[str, float],
        finish: str,
        lining: str | None = None,
        *,
        open_side: str = "front",
    ) -> None:
        """A box of walls, open at the front or the top, from one corner to the other; inner faces may have a lining.

        `wall` is the thickness of all walls or, by side (left, right, bottom, top, back, front), of each.
        """
        sides = ("left", "right", "bottom", "top", "back", "front")
        thick = wall if isinstance(wall, dict) else dict.fromkeys(sides, wall)
        x0, y0, z0 = low
        x1, y1, z1 = high
        inner_x0, inner_x1 = x0 + thick["left"], x1 - thick["right"]
        inner_z0 = z0 + thick["bottom"]
        inner_y1 = y1 - thick["back"]
        inner_z1 = z1 if open_side == "top" else z1 - thick["top"]
        inner_y0 = y0 if open_side == "front" else y0 + thick["front"]
        walls = {
            "left": ((x0, y0, z0), (inner_x0, y1, z1)),
            "right": ((inner_x1, y0, z0), (x1, y1, z1)),
            "bottom": ((inner_x0, y0, z0), (inner_x1, y1, inner_z0)),
            "back": ((inner_x0, inner_y1, inner_z0), (inner_x1, y1, inner_z1)),
            "top": ((inner_x0, y0, inner_z1), (inner_x1, y1, z1)),
            "front": ((inner_x0, y0, inner_z0), (inner_x1, inner_y0, inner_z1)),
        }
        skin = 0.001
        inside = {
            "left": ((inner_x0, inner_y0, inner_z0), (inner_x0 + skin, inner_y1, inner_z1)),
            "right": ((inner_x1 - skin, inner_y0, inner_z0), (inner_x1, inner_y1, inner_z1)),
            "bottom": ((inner_x0, inner_y0, inner_z0), (inner_x1, inner_y1, inner_z0 + skin)),
            "back": ((inner_x0, inner_y1 - skin, inner_z0), (inner_x1, inner_y1, inner_z1)),
            "top": ((inner_x0, inner_y0, inner_z1 - skin), (inner_x1, inner_y1, inner_z1)),
            "front": ((inner_x0, inner_y0, inner_z0), (inner_x1, inner_y0 + skin, inner_z1)),
        }
        for side in sides:
            if side == open_side:
                continue
            self.span(body, *walls[side], finish)
            if lining is not None:
                self.span(body, *inside[side], lining, collide=False)

    def span(
        self, body: mujoco.MjsBody, low: Vector, high: Vector, finish: str, *, name: str = "", collide: bool = True
    ) -> None:
        """A box from one corner to the other."""
        a, b = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        self.box(body, (a + b) / 2, b - a, finish, name=name, collide=collide)

    def site(self, body: mujoco.MjsBody, part: str, pos: Vector) -> None:
        """A named point."""
        body.add_site(name=f"{self.name}_{part}", pos=list(pos), size=[0.005, 0, 0], group=5)
