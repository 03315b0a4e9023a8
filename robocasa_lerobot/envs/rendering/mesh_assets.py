"""Adds meshes to a spec in bulk: made ones, and copies of a compiled model's."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.tessellation import Surface

_SHELL = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # flat meshes have no volume


def add_surface(spec: mujoco.MjSpec, surface: Surface, name: str) -> None:
    """Add a mesh with normals and texture coordinates at its vertices.

    As a file in MuJoCo's own binary format, in memory: number by number it takes five times as long.
    """
    count = len(surface.vertices)
    mesh = spec.add_mesh(name=name)
    mesh.file = f"{name}.msh"
    spec.assets[mesh.file] = b"".join(
        (
            np.array((count, count, count, len(surface.faces)), dtype="<i4").tobytes(),
            surface.vertices.astype("<f4").tobytes(),
            surface.normals.astype("<f4").tobytes(),
            surface.texcoords.astype("<f4").tobytes(),
            surface.faces.astype("<i4").tobytes(),
        )
    )
    mesh.inertia = _SHELL


def copy_mesh(spec: mujoco.MjSpec, model: mujoco.MjModel, index: int) -> str:
    """Name of a copy of a model's mesh, added when it is first asked for."""
    name = f"mesh{index}"
    if spec.mesh(name) is not None:
        return name

    def rows(
        values: NDArray[np.generic], start: NDArray[np.int32], count: NDArray[np.int32]
    ) -> list[float]:  # as a list: of an array every number becomes an object of numpy's first
        found: list[float] = values[start[index] : start[index] + count[index]].ravel().tolist()
        return found

    mesh = spec.add_mesh(name=name)
    mesh.uservert = rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum)
    mesh.usernormal = rows(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum)
    mesh.userface = rows(model.mesh_face, model.mesh_faceadr, model.mesh_facenum)
    mesh.userfacenormal = rows(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum)
    if model.mesh_texcoordadr[index] >= 0:
        mesh.usertexcoord = rows(model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum)
        mesh.userfacetexcoord = rows(model.mesh_facetexcoord, model.mesh_faceadr, model.mesh_facenum)
    mesh.inertia = _SHELL
    return name
