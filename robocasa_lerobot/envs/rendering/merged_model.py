"""A look-alike of a model that draws faster: the visible shapes of each body merged into a few meshes.

A kitchen has hundreds of boards and bars. What each of them costs when it is drawn (its state changes in OpenGL)
adds up to more than its pixels do. The look-alike has one mesh for each body and material; it is a model without
physics, whose poses are copied from the simulation for every picture. It is made from the compiled model alone, so
it fits kitchens and recorded MJCF files alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.quaternions import matrices
from robocasa_lerobot.envs.rendering.canvas import BACKDROP_GROUP
from robocasa_lerobot.envs.rendering.frustum import opaque as opaque_geoms
from robocasa_lerobot.envs.rendering.hidden_faces import shown_faces
from robocasa_lerobot.envs.rendering.merged_shapes import merged_shapes
from robocasa_lerobot.envs.rendering.mesh_assets import add_surface, copy_mesh
from robocasa_lerobot.envs.rendering.rest_poses import RestPoses
from robocasa_lerobot.envs.rendering.software.arrays import Shapes
from robocasa_lerobot.envs.rendering.software.triangles import shapes_of
from robocasa_lerobot.envs.rendering.view_grid import on_grid

Array = NDArray[np.float64]

VISIBLE_GROUPS = (1, 2)  # of MuJoCo's default options, less the collision shapes
VISIBLE_GROUP = 1  # of all geoms of a look-alike but its backdrop
# Edge of the squares of floor over which bodies that never move are merged: culling still tells them apart.
CELL_M = 2.0
_LENSES = ("cam_fovy", "cam_sensorsize", "cam_intrinsic", "cam_resolution")
MIN_SAVED_DRAWS = 50  # below it, a look-alike costs more memory and building time than it is worth
_BOX, _MESH = int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_MESH)
_CYLINDER, _CAPSULE = int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE)
_MERGED = (_BOX, _CYLINDER, _CAPSULE)
_KEPT = (
    int(mujoco.mjtGeom.mjGEOM_PLANE),
    int(mujoco.mjtGeom.mjGEOM_SPHERE),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    _MESH,
)
# Of a light or camera, the fields that are copied as they stand; its pose is copied with every picture.
_LIGHT_FIELDS = (
    *("type", "castshadow", "active", "bulbradius", "intensity", "range"),
    *("attenuation", "cutoff", "exponent", "ambient", "diffuse", "specular"),
)
_CAMERA_FIELDS = ["projection", "fovy", "ipd", "resolution", "sensorsize", "intrinsic"]
_VISUAL_PARTS = ["global_", "quality", "headlight", "map", "scale", "rgba"]


@dataclass
class MergedModel:
    """A model to draw instead of `source`, and its poses.

    Attributes:
        source: the model that is simulated.
        model, data: the scene to draw.
        bodies: of the source, by geom of the look-alike; shape (n,).
        geoms: of the source, by geom of the look-alike: the first one of those that were merged; shape (n,).
        loose: geoms of the source that are drawn for themselves because their looks have changed at run time.
    """

    source: mujoco.MjModel
    model: mujoco.MjModel
    bodies: NDArray[np.intp]
    geoms: NDArray[np.intp]
    loose: frozenset[int]

    def __post_init__(self) -> None:
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self._rotations = matrices(self.model.geom_quat)
        self._colours = self.source.geom_rgba.copy()
        self._kinds = _kinds(self.source)
        self._colours_matter = np.ones(self.source.ngeom, dtype=bool)
        self._colours_matter[list(self.loose)] = False  # they are copied with every picture

    @cached_property
    def shapes(self) -> Shapes | None:
        """Its triangles, made when they are first asked for; None where only OpenGL can draw it."""
        return shapes_of(self.model)

    def follow(self, data: mujoco.MjData) -> None:
        """Take the poses of `data`, and the present colours of the source's materials."""
        source, model, own = self.source, self.model, self.data
        rotations = data.xmat.reshape(-1, 3, 3)[self.bodies]
        own.geom_xpos[:] = data.xpos[self.bodies] + (rotations @ model.geom_pos[:, :, None])[:, :, 0]
        own.geom_xmat[:] = (rotations @ self._rotations).reshape(-1, 9)
        own.cam_xpos[:], own.cam_xmat[:] = on_grid(data.cam_xpos, data.cam_xmat)
        own.light_xpos[:], own.light_xdir[:] = data.light_xpos, data.light_xdir
        for name in (*_LENSES, "light_active", "light_diffuse"):
            getattr(model, name)[:] = getattr(source, name)
        for name in ("mat_rgba", "mat_emission"):
            getattr(model, name)[:] = np.repeat(getattr(source, name), 2, axis=0)  # baked and not
        model.geom_rgba[:] = source.geom_rgba[self.geoms]

    def looks(self) -> Array:
        """Pose, colour and glow of each of its geoms, (n, 21): where two of these are alike the geom is drawn alike."""
        model, data = self.model, self.data
        materials = np.column_stack((model.mat_rgba, model.mat_emission))
        materials = np.concatenate((materials, np.zeros((1, 5))))[model.geom_matid]  # the last one for no material
        return np.column_stack((data.geom_xpos, data.geom_xmat, model.geom_rgba, materials))

    def view(self, camera: int) -> bytes:
        """From where, how wide and in what light a camera sees: views that are alike have the same bytes."""
        model, data = self.model, self.data
        camera_is = (data.cam_xpos[camera], data.cam_xmat[camera], *(getattr(model, name)[camera] for name in _LENSES))
        lights = (data.light_xpos, data.light_xdir, model.light_active, model.light_diffuse)
        return b"".join(np.asarray(value).tobytes() for value in (*camera_is, *lights))

    def changed(self) -> frozenset[int]:
        """Geoms of the source that no longer look as when the look-alike was made, so that it must be made anew."""
        source = self.source
        kinds = _kinds(source)
        if np.array_equal(source.geom_rgba, self._colours) and np.array_equal(kinds, self._kinds):
            return frozenset()
        recoloured = (source.geom_rgba != self._colours).any(axis=1) & self._colours_matter
        return frozenset(np.flatnonzero(recoloured | (kinds != self._kinds).any(axis=1)).tolist())


def merged_model(
    model: mujoco.MjModel, groups: tuple[int, ...], loose: frozenset[int] = frozenset(), *, always: bool = False
) -> MergedModel | None:
    """Make the look-alike of the geoms in `groups`; None where it would save little, or could not show everything.

    `always` makes it however little it saves.

    Boxes, cylinders, capsules and untextured meshes of one body, material and colour become one mesh, but for the
    `loose` ones and transparent ones. Other shapes are taken over as they are.
    """
    if model.nskin or model.nflex or model.ntendon or model.nhfield:
        return None
    own = np.isin(np.arange(model.ngeom), sorted(loose))  # kept where they are hidden: they may be shown again
    visible = np.isin(model.geom_group, groups) & ((model.geom_rgba[:, 3] > 0) | own)
    if not np.isin(model.geom_type[visible], (*_MERGED, *_KEPT)).all():
        return None
    poses = RestPoses.of(model)
    shown = _shown_faces(model, poses, visible, loose)
    parts = _parts(model, poses, visible & shown.any(axis=1), loose)
    if visible.sum() - len(parts) < MIN_SAVED_DRAWS and not (always and parts):
        return None
    spec = mujoco.MjSpec()
    _add_textures_and_materials(spec, model)
    _add_parts(spec, model, poses, shown, parts)
    for camera in range(model.ncam):
        spec.worldbody.add_camera(name=f"camera{camera}")
    for light in range(model.nlight):
        spec.worldbody.add_light(name=f"light{light}")
    made = spec.compile()
    _copy_looks(model, made)
    first = np.array([geoms[0] for geoms in parts], dtype=np.intp)
    bodies = np.where(poses.fixed[first], 0, model.geom_bodyid[first]).astype(np.intp)
    return MergedModel(model, made, bodies, first, loose)


def _shown_faces(
    model: mujoco.MjModel, poses: RestPoses, visible: NDArray[np.bool_], loose: frozenset[int]
) -> NDArray[np.bool_]:
    """Which faces of a geom, if it is a box, are drawn, (ngeom, 6): those of one body hide some."""
    shown = np.ones((model.ngeom, 6), dtype=np.bool_)
    chosen = visible & (model.geom_type == _BOX) & opaque_geoms(model)
    chosen[list(loose)] = False
    for group in (poses.fixed, ~poses.fixed):
        geoms = np.flatnonzero(chosen & group)
        bodies = np.where(poses.fixed, 0, model.geom_bodyid)[geoms]
        shown[geoms] = shown_faces(poses.positions[geoms], poses.rotations[geoms], model.geom_size[geoms], bodies)
    return shown


def _parts(
    model: mujoco.MjModel, poses: RestPoses, visible: NDArray[np.bool_], loose: frozenset[int]
) -> list[list[int]]:
    """Geoms that are drawn together: of one body, or, where nothing moves, of one cell of the room."""
    mergeable = _mergeable(model, loose)
    cells = np.floor(poses.positions[:, :2] / CELL_M).tolist()
    alone, in_room = (~mergeable).tolist(), (poses.fixed & mergeable).tolist()
    bodies, materials, colours = model.geom_bodyid.tolist(), model.geom_matid.tolist(), model.geom_rgba.tolist()
    parts: dict[tuple[float, ...], list[int]] = {}
    for geom in np.flatnonzero(visible).tolist():
        where = (-1, *cells[geom]) if in_room[geom] else (bodies[geom], 0, 0)
        key = (*where, materials[geom], geom if alone[geom] else -1, *colours[geom])
        parts.setdefault(key, []).append(geom)
    return list(parts.values())


def _add_textures_and_materials(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    for index in range(model.ntex):
        texture = spec.add_texture(name=f"texture{index}", builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT)
        texture.type = mujoco.mjtTexture(int(model.tex_type[index]))
        texture.width, texture.height = int(model.tex_width[index]), int(model.tex_height[index])
        texture.nchannel = int(model.tex_nchannel[index])
    for index in range(model.nmat):
        # The first of the two is for merged meshes, whose texture coordinates have the repetition in them.
        for name, baked in ((f"baked{index}", True), (f"material{index}", False)):
            material = spec.add_material(name=name)
            material.rgba = model.mat_rgba[index]
            material.emission = model.mat_emission[index]
            material.specular = model.mat_specular[index]
            material.shininess = model.mat_shininess[index]
            material.reflectance = model.mat_reflectance[index]
            material.texrepeat = (1.0, 1.0) if baked else model.mat_texrepeat[index]
            material.texuniform = False if baked else bool(model.mat_texuniform[index])
            textures = material.textures  # changed in place: setting it takes half a millisecond
            for role, texture in enumerate(model.mat_texid[index].tolist()):
                if texture >= 0:
                    textures[role] = f"texture{texture}"


def _add_parts(
    spec: mujoco.MjSpec, model: mujoco.MjModel, poses: RestPoses, shown: NDArray[np.bool_], parts: list[list[int]]
) -> None:
    first = np.array([geoms[0] for geoms in parts], dtype=np.intp)
    kinds, materials = model.geom_type[first].tolist(), model.geom_matid[first].tolist()
    behind = ((model.geom_bodyid[first] == 0) & (model.geom_group[first] == BACKDROP_GROUP)).tolist()
    # A single box is drawn as fast by MuJoCo itself; a round shape is not, with its facets for all sizes.
    merged = [len(geoms) > 1 or kind in (_CYLINDER, _CAPSULE) for geoms, kind in zip(parts, kinds, strict=True)]
    shapes = iter(merged_shapes(model, poses, shown, [parts[index] for index in np.flatnonzero(merged)]))
    for index, source in enumerate(first.tolist()):
        geom = spec.worldbody.add_geom()
        if merged[index]:
            geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, f"part{index}"
            add_surface(spec, next(shapes), geom.meshname)
        else:
            geom.type = mujoco.mjtGeom(kinds[index])
            geom.pos, geom.quat, geom.size = poses.positions[source], poses.quats[source], model.geom_size[source]
            if kinds[index] == _MESH:
                geom.meshname = copy_mesh(spec, model, int(model.geom_dataid[source]))
        geom.group = BACKDROP_GROUP if behind[index] else VISIBLE_GROUP
        geom.contype = geom.conaffinity = 0
        geom.mass = 0.0
        geom.rgba = model.geom_rgba[source]
        if materials[index] >= 0:
            geom.material = f"{'baked' if merged[index] else 'material'}{materials[index]}"


def _mergeable(model: mujoco.MjModel, loose: frozenset[int]) -> NDArray[np.bool_]:
    """Geoms whose triangles are known, (ngeom,): of meshes those without texture coordinates."""
    untextured = np.append((model.mat_texid < 0).all(axis=1), True)[model.geom_matid]  # the last for no material
    known = np.isin(model.geom_type, _MERGED) | ((model.geom_type == _MESH) & untextured)
    known[list(loose)] = False
    return np.asarray(known & opaque_geoms(model))


def _copy_textures(source: mujoco.MjModel, made: mujoco.MjModel) -> None:
    """Copy pixels; a cube whose faces are one picture of a file has it once there, and six times where it is made."""

    def pixels(model: mujoco.MjModel, index: int) -> NDArray[np.uint8]:
        size = model.tex_width[index] * model.tex_height[index] * model.tex_nchannel[index]
        return model.tex_data[model.tex_adr[index] : model.tex_adr[index] + size]

    for index in range(source.ntex):
        old, new = pixels(source, index), pixels(made, index)
        new[:] = np.tile(old, len(new) // len(old))


def _copy_looks(source: mujoco.MjModel, made: mujoco.MjModel) -> None:
    _copy_textures(source, made)
    for kind, names in (("light", _LIGHT_FIELDS), ("cam", _CAMERA_FIELDS)):
        for name in names:
            getattr(made, f"{kind}_{name}")[:] = getattr(source, f"{kind}_{name}")
    for part in _VISUAL_PARTS:
        old, new = getattr(source.vis, part), getattr(made.vis, part)
        for name in dir(old):
            if not name.startswith("_"):
                setattr(new, name, getattr(old, name))
    made.stat.extent = source.stat.extent
    made.stat.center[:] = source.stat.center


def _kinds(model: mujoco.MjModel) -> NDArray[np.int32]:
    """Material and group of each geom, which may be changed at run time to show a state; shape (ngeom, 2)."""
    return np.column_stack((model.geom_matid, model.geom_group))
