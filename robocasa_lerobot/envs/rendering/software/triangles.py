"""The triangles of a model's geoms, with what MuJoCo would generate for them: corners, normals, texture coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.canvas import BACKDROP_GROUP
from robocasa_lerobot.envs.rendering.sharp_corners import flat_normals, sharp_corners
from robocasa_lerobot.envs.rendering.software.arrays import Shapes
from robocasa_lerobot.envs.rendering.software.textures import Textures
from robocasa_lerobot.envs.rendering.tessellation import Surface, spheres, textured, unit_box

_PLANE, _SPHERE = int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_SPHERE)
_ELLIPSOID, _BOX = int(mujoco.mjtGeom.mjGEOM_ELLIPSOID), int(mujoco.mjtGeom.mjGEOM_BOX)
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_DIRECTIONAL, _SPOT = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL), int(mujoco.mjtLightType.mjLIGHT_SPOT)
_FLAT = int(mujoco.mjtTexture.mjTEXTURE_2D)
_QUAD_M = 0.3  # as long as parts of a box's edge get, up to MuJoCo's number of them


def shapes_of(model: mujoco.MjModel) -> Shapes | None:
    """All geoms of a model as triangles; None where it has what only OpenGL draws here.

    That is: shapes of other kinds than planes with edges, spheres, ellipsoids, boxes and meshes; textures that are
    cubes, or on others than boxes and meshes; cameras without perspective; pixels of several samples;
    lights of other kinds than far ones and spots.
    """
    kinds = model.geom_type
    texture_of = _textures_of(model)
    textured = texture_of >= 0
    endless = (kinds == _PLANE) & (model.geom_size[:, :2] <= 0.0).any(axis=1)
    if (
        not np.isin(kinds, (_PLANE, _SPHERE, _ELLIPSOID, _BOX, _MESH)).all()
        or endless.any()
        or not np.isin(kinds[textured], (_BOX, _MESH)).all()
        or (model.tex_type[texture_of[textured]] != _FLAT).any()
        or (model.cam_projection != 0).any()
        or model.vis.quality.offsamples != 0
        or not np.isin(model.light_type, (_DIRECTIONAL, _SPOT)).all()
    ):
        return None
    meshes = _meshes(model)
    surfaces = [_surface(model, geom, meshes) for geom in range(model.ngeom)]
    vertex_counts = [len(surface.vertices) for surface in surfaces]
    first_vertex = np.concatenate(([0], np.cumsum(vertex_counts, dtype=np.int32))).astype(np.int32)
    face_counts = [len(surface.faces) for surface in surfaces]
    faces = np.concatenate([surface.faces for surface in surfaces])
    faces = (faces + np.repeat(first_vertex[:-1], face_counts)[:, None]).astype(np.int32)
    textures = Textures.of(model)
    return Shapes(
        first_vertex,
        np.concatenate([surface.vertices for surface in surfaces]).astype(np.float32),
        np.concatenate([surface.normals for surface in surfaces]).astype(np.float32),
        np.concatenate([surface.texcoords for surface in surfaces]).astype(np.float32),
        np.concatenate(([0], np.cumsum(face_counts, dtype=np.int32))).astype(np.int32),
        faces,
        np.repeat(np.arange(model.ngeom, dtype=np.int32), face_counts),
        np.where(kinds == _PLANE, 0.0, model.geom_rbound),
        model.geom_aabb.reshape(-1, 6).astype(np.float64),
        model.geom_group == BACKDROP_GROUP,
        texture_of,
        textures.texels,
        textures.levels,
        textures.counts,
    )


def _textures_of(model: mujoco.MjModel) -> NDArray[np.int32]:
    """Number of each geom's texture, -1 for none, (ngeom,)."""
    of_materials = np.append(model.mat_texid.max(axis=1, initial=-1), -1)  # the last one for no material
    return of_materials[model.geom_matid].astype(np.int32)


def _surface(model: mujoco.MjModel, geom: int, meshes: Sequence[Surface]) -> Surface:
    """One geom in its own frame."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _MESH:
        mesh = int(model.geom_dataid[geom])
        surface = meshes[mesh]
        if model.mesh_texcoordadr[mesh] < 0:
            return Surface(surface.vertices, surface.normals, _generated(model, geom, surface.vertices), surface.faces)
        return surface
    if kind in (_BOX, _PLANE):
        halves = np.array((size[0], size[1], size[2] if kind == _BOX else 0.0))
        unit = unit_box(_quads(model, halves), only_top=kind == _PLANE)
        texcoords = textured(unit.texcoords, _repeat(model, geom, size))
        return Surface(unit.vertices * halves, unit.normals, texcoords, unit.faces)
    halves = size if kind == _ELLIPSOID else np.full(3, size[0])
    return spheres(halves, model.vis.quality.numslices, model.vis.quality.numstacks)


def _quads(model: mujoco.MjModel, halves: NDArray[np.float64]) -> tuple[int, int, int]:
    """Into how many parts each edge of a box is parted, so that highlights are seen within its faces.

    MuJoCo parts all of them into `numquads`; those of small boxes are left whole, where that is hardly seen.
    """
    x, y, z = np.clip(np.ceil(2 * halves / _QUAD_M), 1, model.vis.quality.numquads).astype(int).tolist()
    return x, y, z


def _repeat(model: mujoco.MjModel, geom: int, size: NDArray[np.float64]) -> NDArray[np.float64]:
    """How often a texture is repeated over a box, (2,)."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return np.ones(2)
    repeat = model.mat_texrepeat[material].astype(np.float64)
    return repeat * size[:2] if model.mat_texuniform[material] else repeat


def _generated(model: mujoco.MjModel, geom: int, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Texture coordinates (n, 2) of a mesh that has none of its own."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return np.zeros((len(vertices), 2))
    repeat = model.mat_texrepeat[material]
    scale = np.ones(2) if model.mat_texuniform[material] else model.geom_size[geom, :2]
    return np.asarray(0.5 * repeat * (1.0 + vertices[:, :2] / scale * (1.0, -1.0)))


def _meshes(model: mujoco.MjModel) -> list[Surface]:
    """All meshes of a model, a vertex for each combination of corner, normal and texture coordinate that occurs."""
    if model.nmesh == 0:
        return []
    mesh_of = np.repeat(np.arange(model.nmesh), model.mesh_facenum)
    has_texcoords = model.mesh_texcoordadr >= 0
    texcoord_of = np.where(has_texcoords[mesh_of, None], model.mesh_facetexcoord, model.mesh_face)
    # All of them at once: mesh by mesh, numpy's calls cost more than their work.
    points = model.mesh_vert[model.mesh_face + model.mesh_vertadr[mesh_of, None]]
    flat = flat_normals(points)
    normals = model.mesh_normal[model.mesh_facenormal + model.mesh_normaladr[mesh_of, None]]
    sharp = sharp_corners(flat, normals) & ~has_texcoords[mesh_of, None]
    alike = (model.mesh_face == model.mesh_facenormal) & (model.mesh_face == texcoord_of) & ~sharp
    plain = np.logical_and.reduceat(alike.all(axis=1), model.mesh_faceadr).tolist()
    return [
        _plain_mesh(model, mesh) if plain[mesh] else _mesh(model, mesh, sharp, flat, texcoord_of)
        for mesh in range(model.nmesh)
    ]


def _plain_mesh(model: mujoco.MjModel, mesh: int) -> Surface:
    """A mesh whose corners, normals and texture coordinates have the same numbers."""
    face, vertex, normal = (int(at[mesh]) for at in (model.mesh_faceadr, model.mesh_vertadr, model.mesh_normaladr))
    count, texcoord = int(model.mesh_vertnum[mesh]), int(model.mesh_texcoordadr[mesh])
    return Surface(
        model.mesh_vert[vertex : vertex + count],
        model.mesh_normal[normal : normal + count],
        model.mesh_texcoord[texcoord : texcoord + count] if texcoord >= 0 else np.zeros((count, 2)),
        model.mesh_face[face : face + int(model.mesh_facenum[mesh])],
    )


def _mesh(
    model: mujoco.MjModel,
    mesh: int,
    sharp: NDArray[np.bool_],
    flat: NDArray[np.float64],
    texcoord_of: NDArray[np.int32],
) -> Surface:
    """Any mesh; corners that are `sharp`, (faces of the model, 3), get the `flat` normal of their triangle."""
    mine = slice(int(model.mesh_faceadr[mesh]), int(model.mesh_faceadr[mesh] + model.mesh_facenum[mesh]))
    first_normal, count = int(model.mesh_normaladr[mesh]), int(model.mesh_normalnum[mesh])
    own = count + np.arange(mine.stop - mine.start)[:, None]  # what is no other triangle's
    normal_of = np.where(sharp[mine], own, model.mesh_facenormal[mine])
    normals = np.concatenate((model.mesh_normal[first_normal : first_normal + count], flat[mine]))
    # One number of the three, which each stay below 2**21.
    key = (model.mesh_face[mine].astype(np.int64) << 42) + (normal_of.astype(np.int64) << 21) + texcoord_of[mine]
    key, faces = np.unique(key, return_inverse=True)
    corners, directions, texcoords = key >> 42, (key >> 21) & 0x1FFFFF, key & 0x1FFFFF
    first = int(model.mesh_texcoordadr[mesh])
    return Surface(
        model.mesh_vert[int(model.mesh_vertadr[mesh]) + corners],
        normals[directions],
        model.mesh_texcoord[first + texcoords] if first >= 0 else np.zeros((len(corners), 2)),
        faces.reshape(-1, 3).astype(np.int32),
    )
