"""The shapes of a look-alike's parts, of a whole scene at once: one by one, numpy's calls cost more than their work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.rest_poses import RestPoses
from robocasa_lerobot.envs.rendering.sharp_corners import flat_normals, sharp_corners
from robocasa_lerobot.envs.rendering.tessellation import Surface, boxes, capsules, cylinders, textured, used_slices

Array = NDArray[np.float64]
Counts = NDArray[np.intp]

_BOX, _MESH = int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_MESH)
_CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)


def merged_shapes(
    model: mujoco.MjModel, poses: RestPoses, shown: NDArray[np.bool_], parts: Sequence[Sequence[int]]
) -> list[Surface]:
    """The shape of each part, geoms of one body and material, with texture coordinates as MuJoCo generates them.

    Args:
        model: whose geoms they are: boxes, cylinders, capsules and meshes without texture.
        poses: where they are drawn; the shapes are in that frame.
        shown: which faces of a geom, if it is a box, are drawn, (ngeom, 6).
        parts: geoms of each; boxes come last in its shape.
    """
    if not parts:
        return []
    geoms = np.concatenate([np.asarray(part, dtype=np.intp) for part in parts])
    part = np.repeat(np.arange(len(parts)), [len(members) for members in parts])
    order = np.lexsort((model.geom_type[geoms] == _BOX, part))
    geoms, part = geoms[order], part[order]
    groups = _groups(model, poses, shown, geoms)
    # From the order of groups to that of parts.
    back = np.argsort(np.concatenate([group.places for group in groups]))
    vertex_counts = np.concatenate([group.vertex_counts for group in groups])
    face_counts = np.concatenate([group.face_counts for group in groups])
    vertices = _ranges(_starts(vertex_counts)[back], vertex_counts[back])
    faces = _ranges(_starts(face_counts)[back], face_counts[back])
    vertex_counts, face_counts = vertex_counts[back], face_counts[back]
    first = np.searchsorted(part, np.arange(len(parts)))  # geom of each part
    starts = _starts(vertex_counts)
    within = (starts - starts[first][part]).astype(np.int32)  # where a geom's vertices begin in its part
    whole = Surface(
        np.concatenate([group.surface.vertices for group in groups])[vertices],
        np.concatenate([group.surface.normals for group in groups])[vertices],
        np.concatenate([group.surface.texcoords for group in groups])[vertices],
        np.concatenate([group.surface.faces for group in groups])[faces] + np.repeat(within, face_counts)[:, None],
    )
    vertex_ends = np.append(starts[first][1:], len(vertices)).tolist()
    face_ends = np.append(_starts(face_counts)[first][1:], len(faces)).tolist()
    shapes = []
    vertex = face = 0
    for vertex_end, face_end in zip(vertex_ends, face_ends, strict=True):
        mine = slice(vertex, vertex_end)
        shapes.append(
            Surface(whole.vertices[mine], whole.normals[mine], whole.texcoords[mine], whole.faces[face:face_end])
        )
        vertex, face = vertex_end, face_end
    return shapes


@dataclass(frozen=True)
class _Group:
    """Shapes of geoms that are made together.

    Attributes:
        places: of the geoms in the list that was asked for, (n,).
        surface: of all of them, one after the other; faces count the vertices of their own geom.
        vertex_counts, face_counts: of each, (n,).
    """

    places: Counts
    surface: Surface
    vertex_counts: Counts
    face_counts: Counts


def _groups(model: mujoco.MjModel, poses: RestPoses, shown: NDArray[np.bool_], geoms: Counts) -> list[_Group]:
    """The shapes of geoms: boxes together, round ones by kind and number of facets, meshes together."""
    kinds, sizes = model.geom_type[geoms], model.geom_size[geoms]
    is_box, is_mesh = kinds == _BOX, kinds == _MESH
    plane = np.where(is_box[:, None], sizes[:, :2], sizes[:, :1])  # half sizes in the plane of the texture
    repeat = _repetitions(model, geoms, plane)
    groups = []
    if is_box.any():
        places = np.flatnonzero(is_box)
        groups.append(_boxes(poses, shown, geoms, places, sizes, repeat))
    if is_mesh.any():
        groups.append(_meshes(model, poses, geoms, np.flatnonzero(is_mesh), repeat))
    slices = used_slices(sizes[:, 0], int(model.vis.quality.numslices))
    round_ = ~is_box & ~is_mesh
    for kind, count in sorted(set(zip(kinds[round_].tolist(), slices[round_].tolist(), strict=True))):
        places = np.flatnonzero(round_ & (kinds == kind) & (slices == count))
        groups.append(_round(poses, geoms, places, kind == _CYLINDER, count, sizes, repeat))
    return groups


def _boxes(
    poses: RestPoses, shown: NDArray[np.bool_], geoms: Counts, places: Counts, sizes: Array, repeat: Array
) -> _Group:
    chosen = geoms[places]
    surface = boxes(sizes[places], poses.positions[chosen], poses.rotations[chosen], repeat[places], shown[chosen])
    faces = shown[chosen].sum(axis=1)
    return _Group(places, _each_for_itself(surface, 4 * faces, 2 * faces), 4 * faces, 2 * faces)


def _round(
    poses: RestPoses, geoms: Counts, places: Counts, is_cylinder: bool, slices: int, sizes: Array, repeat: Array
) -> _Group:
    chosen, count = geoms[places], len(places)
    of_kind = cylinders if is_cylinder else capsules
    made = of_kind(
        sizes[places, 0], sizes[places, 1], slices, poses.positions[chosen], poses.rotations[chosen], repeat[places]
    )
    vertices, faces = len(made.vertices) // count, len(made.faces) // count
    counts = np.full(count, vertices), np.full(count, faces)
    return _Group(places, _each_for_itself(made, *counts), *counts)


def _meshes(model: mujoco.MjModel, poses: RestPoses, geoms: Counts, places: Counts, repeat: Array) -> _Group:
    """With a vertex for each pair of a place and a normal; sharp corners get their triangle's, as MuJoCo gives them.

    A look-alike has texture coordinates, so that MuJoCo takes its normals as they are.
    """
    used, which = np.unique(model.geom_dataid[geoms[places]], return_inverse=True)
    face_counts = model.mesh_facenum[used].astype(np.intp)
    corners = _ranges(model.mesh_faceadr[used].astype(np.intp), face_counts)
    where = model.mesh_face[corners] + np.repeat(model.mesh_vertadr[used], face_counts)[:, None]
    facing = model.mesh_facenormal[corners] + np.repeat(model.mesh_normaladr[used], face_counts)[:, None]
    flat = flat_normals(model.mesh_vert[where])
    bare = np.repeat(model.mesh_texcoordadr[used] < 0, face_counts)
    sharp = sharp_corners(flat, model.mesh_normal[facing]) & bare[:, None]
    facing = np.where(sharp, len(model.mesh_normal) + np.arange(len(corners))[:, None], facing)
    known = np.concatenate((model.mesh_normal, flat))
    normals = np.int64(len(known))
    pairs, corner_pairs = np.unique(where * normals + facing, return_inverse=True)
    where, facing = np.divmod(pairs, normals)
    # Pairs are in the order of places, and so of meshes, whose numbers are in that order too.
    pair_starts = np.searchsorted(where, model.mesh_vertadr[used])
    pair_ends = np.append(pair_starts[1:], len(pairs))
    face_starts = _starts(face_counts)
    faces = (corner_pairs.reshape(-1, 3) - np.repeat(pair_starts, face_counts)[:, None]).astype(np.int32)
    vertices, facings = model.mesh_vert[where].astype(np.float64), known[facing].astype(np.float64)
    found: list[tuple[Array, Array, NDArray[np.int32]]] = []
    for geom, mesh in zip(geoms[places].tolist(), which.tolist(), strict=True):
        mine = slice(pair_starts[mesh], pair_ends[mesh])
        turned = poses.rotations[geom].T
        own = faces[face_starts[mesh] : face_starts[mesh] + face_counts[mesh]]
        found.append((vertices[mine] @ turned + poses.positions[geom], facings[mine] @ turned, own))
    counts = (pair_ends - pair_starts)[which]
    surface = Surface(
        np.concatenate([shape[0] for shape in found]),
        np.concatenate([shape[1] for shape in found]),
        np.repeat(textured(np.zeros(2), repeat[places]), counts, axis=0),
        np.concatenate([shape[2] for shape in found]),
    )
    return _Group(places, surface, counts, face_counts[which])


def _each_for_itself(surface: Surface, vertex_counts: Counts, face_counts: Counts) -> Surface:
    """A surface of several shapes whose faces count the vertices of their own shape."""
    own = np.repeat(_starts(vertex_counts), face_counts).astype(np.int32)
    return Surface(surface.vertices, surface.normals, surface.texcoords, surface.faces - own[:, None])


def _repetitions(model: mujoco.MjModel, geoms: Counts, sizes: Array) -> Array:
    """How often the texture of a geom is repeated over a shape of half sizes (n, 2) in its plane, (n, 2)."""
    materials = model.geom_matid[geoms]
    if not model.nmat:
        return np.ones_like(sizes)
    repeat = model.mat_texrepeat[materials].astype(np.float64)
    repeat = np.where(model.mat_texuniform[materials][:, None] != 0, repeat * sizes, repeat)  # uniform: per metre
    return np.where(materials[:, None] < 0, 1.0, repeat)


def _starts(counts: Counts) -> Counts:
    """Where each of some rows of consecutive numbers begins."""
    return np.cumsum(counts) - counts


def _ranges(starts: Counts, counts: Counts) -> Counts:
    """The numbers from each start on, as many as its count, one row after the other."""
    return np.repeat(starts - _starts(counts), counts) + np.arange(int(counts.sum()))
