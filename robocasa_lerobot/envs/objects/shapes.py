"""Adds an instance to a scene: one mesh per finish to look at, convex pieces of their own to collide with.

The body origin of an object is the centre of its bounding box; z is up as it lies or stands.
"""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.fixtures.base import VISUAL_GROUP
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette
from robocasa_lerobot.envs.objects.catalogue import Instance, Rgba, model_of
from robocasa_lerobot.envs.objects.draft import FINISHES, Model
from robocasa_lerobot.envs.objects.solids import IDENTITY, Solid, about, times

# Contact parameters of objects (docs/robocasa.md, section 6); torsional friction keeps them from spinning in a grasp.
FRICTION = (0.95, 0.3, 0.1)
ROLLING_FRICTION = (0.95, 0.05, 0.004)
SOLIMP, SOLREF = (0.998, 0.998, 0.001, 0.5, 2.0), (0.004, 2.0)
COLLISION_GROUP = 0  # which cameras do not show

_KINDS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
}
# Insides that are about as long as wide are round: with facets and handles, they differ by 5 percent at most.
_ROUND_RATIO = 1.15


def add_object(
    spec: mujoco.MjSpec, palette: MaterialPalette, name: str, item: Instance, *, liquid: Rgba | None = None
) -> mujoco.MjsBody:
    """Add a free body `name` (joint `<name>_joint0`) with an instance's geoms, at the world origin; returns it.

    `liquid` fills a hollow one, for the eye only, with a colour (opacity included).
    """
    body = spec.worldbody.add_body(name=name)
    body.add_freejoint(name=f"{name}_joint0")
    shape = model_of(item)
    turn = about(item.upright_axis, -np.pi / 2) if item.upright_axis else IDENTITY
    if item.face_down:
        turn = about("x", np.pi)
    _add_looks(spec, body, name, item, shape, turn)
    pieces = [piece if item.scale == (1, 1, 1) else piece.scaled(item.scale) for piece in shape.solids]
    for index, piece in enumerate(pieces):
        _add_solid(spec, body, f"{name}_c{index}", f"{_variant(item)}_c{index}", piece, shape, turn)
    if liquid is not None and item.interior is not None:
        _add_liquid(body, palette, name, item, liquid)
    return body


def _variant(item: Instance) -> str:
    """Name of what meshes are shared by: the model, and its scale where it has one."""
    if item.scale == (1, 1, 1):
        return item.model
    return f"{item.model}_x" + "_".join(f"{factor:.3f}" for factor in item.scale)


def _add_looks(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, item: Instance, shape: Model, turn: tuple[float, ...]
) -> None:
    texture = f"{item.model}_texture"
    if item.stained is None and spec.texture(texture) is None:
        added = spec.add_texture(name=texture, type=mujoco.mjtTexture.mjTEXTURE_2D)
        added.file = f"objects/{item.model}.png"
        spec.assets[added.file] = shape.png
    for index, (finish, text) in enumerate(shape.meshes.items()):
        mesh_name = f"{_variant(item)}_{finish}"
        if spec.mesh(mesh_name) is None:
            mesh = spec.add_mesh(name=mesh_name, file=f"objects/{item.model}_{finish}.obj")
            mesh.scale = item.scale
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # thin sheets have no volume
            spec.assets[mesh.file] = text
        material_name = f"{name if item.stained else item.model}_{finish}"
        if spec.material(material_name) is None:
            shininess, specular, opacity = FINISHES[finish]
            material = spec.add_material(name=material_name, rgba=(*(item.stained or (1.0, 1.0, 1.0)), opacity))
            material.shininess, material.specular = shininess, specular
            if item.stained is None:
                material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh_name, material=material_name, quat=turn)
        geom.name = f"{name}_v{index}"
        geom.group = VISUAL_GROUP
        geom.contype = geom.conaffinity = 0
        geom.density = 0.0


def _add_solid(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    mesh_name: str,
    piece: Solid,
    shape: Model,
    turn: tuple[float, ...],
) -> None:
    if piece.kind == "hull":
        if spec.mesh(mesh_name) is None:
            spec.add_mesh(name=mesh_name).uservert = np.round(piece.points, 5).ravel()
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh_name, quat=turn)
    else:
        size = [*piece.size, 0.0, 0.0][:3]
        rotated = np.empty(3)
        mujoco.mju_rotVecQuat(rotated, np.asarray(piece.pos, float), np.asarray(turn, float))
        geom = body.add_geom(type=_KINDS[piece.kind], size=size, pos=rotated, quat=times(turn, piece.quat))
    geom.name = name
    geom.group = COLLISION_GROUP
    geom.rgba = (0.0, 0.0, 0.0, 0.0)
    geom.density = shape.density
    geom.solimp, geom.solref = SOLIMP, SOLREF
    # Rolling friction only where something would roll off a worktop.
    geom.condim = 6 if shape.rolls else 4
    geom.friction = ROLLING_FRICTION if shape.rolls else FRICTION


def _add_liquid(body: mujoco.MjsBody, palette: MaterialPalette, name: str, item: Instance, rgba: Rgba) -> None:
    """A disc, or a box, that fills the lower three quarters of what an object holds."""
    inside = item.interior
    assert inside is not None
    level = 0.72
    half_z = inside.half[2] * level
    where = (inside.center[0], inside.center[1], inside.center[2] - inside.half[2] + half_z)
    material = palette.plain(rgba, 0.8)
    narrow, wide = sorted(inside.half[:2])
    if wide < _ROUND_RATIO * narrow:
        radius = narrow * 1.3  # what it holds is a square within the circle
        geom = body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[radius, half_z, 0], pos=where, material=material
        )
    else:
        size = [inside.half[0] * 0.98, inside.half[1] * 0.98, half_z]
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=where, material=material)
    geom.name = f"{name}_liquid"
    geom.group = VISUAL_GROUP
    geom.contype = geom.conaffinity = 0
    geom.density = 0.0
