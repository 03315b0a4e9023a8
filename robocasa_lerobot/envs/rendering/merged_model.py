"""A look-alike of a model that draws faster: the visible shapes of each body merged into a few meshes.

A kitchen has hundreds of boards and bars. What each of them costs when it is drawn (its state changes in OpenGL)
adds up to more than its pixels do. The look-alike has one mesh for each body and material; it is a model without
physics, whose poses are copied from the simulation for every picture. It is made from the compiled model alone, so
it fits kitchens and recorded MJCF files alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.canvas import BACKDROP_GROUP
from robocasa_lerobot.envs.rendering.frustum import opaque as opaque_geoms
from robocasa_lerobot.envs.rendering.hidden_faces import shown_faces
from robocasa_lerobot.envs.rendering.tessellation import Surface, boxes, capsule, cylinder, joined
from robocasa_lerobot.envs.rendering.view_grid import on_grid

Array = NDArray[np.float64]

VISIBLE_GROUPS = (1, 2)  # of MuJoCo's default options, less the collision shapes
VISIBLE_GROUP = 1  # of all geoms of a look-alike but its backdrop
# Edge of the squares of floor over which bodies that never move are merged: culling still tells them apart.
CELL_M = 2.0
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
        self._rotations = _matrices(self.model.geom_quat)
        self._colours = self.source.geom_rgba.copy()
        self._kinds = _kinds(self.source)
        self._colours_matter = np.ones(self.source.ngeom, dtype=bool)
        self._colours_matter[list(self.loose)] = False  # they are copied with every picture

    def follow(self, data: mujoco.MjData) -> None:
        """Take the poses of `data`, and the present colours of the source's materials."""
        source, model, own = self.source, self.model, self.data
        rotations = data.xmat.reshape(-1, 3, 3)[self.bodies]
        own.geom_xpos[:] = data.xpos[self.bodies] + (rotations @ model.geom_pos[:, :, None])[:, :, 0]
        own.geom_xmat[:] = (rotations @ self._rotations).reshape(-1, 9)
        own.cam_xpos[:], own.cam_xmat[:] = on_grid(data.cam_xpos, data.cam_xmat)
        own.light_xpos[:], own.light_xdir[:] = data.light_xpos, data.light_xdir
        for name in ("cam_fovy", "light_active", "light_diffuse"):
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
        camera_is = (data.cam_xpos[camera], data.cam_xmat[camera], model.cam_fovy[camera])
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
    model: mujoco.MjModel, groups: tuple[int, ...], loose: frozenset[int] = frozenset()
) -> MergedModel | None:
    """Make the look-alike of the geoms in `groups`; None where it would save little, or could not show everything.

    Boxes, cylinders, capsules and untextured meshes of one body, material and colour become one mesh, but for the
    `loose` ones and transparent ones. Other shapes are taken over as they are.
    """
    if model.nskin or model.nflex or model.ntendon or model.nhfield:
        return None
    visible = np.isin(model.geom_group, groups) & (model.geom_rgba[:, 3] > 0)
    if not np.isin(model.geom_type[visible], (*_MERGED, *_KEPT)).all():
        return None
    poses = _Poses.of(model)
    shown = _shown_faces(model, poses, visible, loose)
    parts = _parts(model, poses, visible & shown.any(axis=1), loose)
    if visible.sum() - len(parts) < MIN_SAVED_DRAWS:
        return None
    spec = mujoco.MjSpec()
    _add_textures_and_materials(spec, model)
    for index, geoms in enumerate(parts):
        _add_part(spec, model, poses, shown, geoms, f"part{index}")
    for camera in range(model.ncam):
        spec.worldbody.add_camera(name=f"camera{camera}")
    for light in range(model.nlight):
        spec.worldbody.add_light(name=f"light{light}")
    made = spec.compile()
    _copy_looks(model, made)
    first = np.array([geoms[0] for geoms in parts], dtype=np.intp)
    bodies = np.where(poses.fixed[first], 0, model.geom_bodyid[first]).astype(np.intp)
    return MergedModel(model, made, bodies, first, loose)


@dataclass(frozen=True)
class _Poses:
    """Where geoms are drawn: those that never move in the world's frame, the others in their body's.

    Attributes:
        fixed: whether a geom never moves, (ngeom,).
        positions, rotations: (ngeom, 3) and (ngeom, 3, 3).
        quats: wxyz, (ngeom, 4).
    """

    fixed: NDArray[np.bool_]
    positions: Array
    rotations: Array
    quats: Array

    @classmethod
    def of(cls, model: mujoco.MjModel) -> _Poses:
        """Of all geoms of a model."""
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        fixed = (model.body_weldid == 0) & (model.body_mocapid < 0)
        at_rest = fixed[model.geom_bodyid]
        rotations = np.where(at_rest[:, None, None], data.geom_xmat.reshape(-1, 3, 3), _matrices(model.geom_quat))
        positions = np.where(at_rest[:, None], data.geom_xpos, model.geom_pos)
        quats = model.geom_quat.copy()
        for geom in np.flatnonzero(at_rest):
            mujoco.mju_mat2Quat(quats[geom], data.geom_xmat[geom])
        return cls(at_rest, positions, rotations, quats)


def _shown_faces(
    model: mujoco.MjModel, poses: _Poses, visible: NDArray[np.bool_], loose: frozenset[int]
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


def _parts(model: mujoco.MjModel, poses: _Poses, visible: NDArray[np.bool_], loose: frozenset[int]) -> list[list[int]]:
    """Geoms that are drawn together: of one body, or, where nothing moves, of one cell of the room."""
    cells, opaque = np.floor(poses.positions[:, :2] / CELL_M).tolist(), opaque_geoms(model)
    parts: dict[tuple[float, ...], list[int]] = {}
    for geom in np.flatnonzero(visible).tolist():
        material, rgba = int(model.geom_matid[geom]), tuple(model.geom_rgba[geom].tolist())
        mergeable = opaque[geom] and _can_be_merged(model, geom) and geom not in loose
        own = -1 if mergeable else geom
        where = (-1, *cells[geom]) if poses.fixed[geom] and mergeable else (int(model.geom_bodyid[geom]), 0, 0)
        parts.setdefault((*where, material, own, *rgba), []).append(geom)
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


def _add_part(
    spec: mujoco.MjSpec, model: mujoco.MjModel, poses: _Poses, shown: NDArray[np.bool_], geoms: list[int], name: str
) -> None:
    first = geoms[0]
    material = int(model.geom_matid[first])
    kind = int(model.geom_type[first])
    # A single box is drawn as fast by MuJoCo itself; a round shape is not, with its facets for all sizes.
    merged = len(geoms) > 1 or kind in (_CYLINDER, _CAPSULE)
    geom = spec.worldbody.add_geom(type=mujoco.mjtGeom(_MESH if merged else kind))
    if merged:
        _add_mesh(spec, _merged(model, poses, shown, geoms), name)
        geom.meshname = name
    else:
        geom.pos, geom.quat, geom.size = poses.positions[first], poses.quats[first], model.geom_size[first]
        if kind == _MESH:
            geom.meshname = _copied_mesh(spec, model, int(model.geom_dataid[first]))
    backdrop = model.geom_bodyid[first] == 0 and model.geom_group[first] == BACKDROP_GROUP
    geom.group = BACKDROP_GROUP if backdrop else VISIBLE_GROUP
    geom.contype = geom.conaffinity = 0
    geom.mass = 0.0
    geom.rgba = model.geom_rgba[first]
    if material >= 0:
        geom.material = f"{'baked' if merged else 'material'}{material}"


def _merged(model: mujoco.MjModel, poses: _Poses, shown: NDArray[np.bool_], geoms: list[int]) -> Surface:
    """The shape of geoms of one body and material in its frame, with texture coordinates as MuJoCo generates them."""
    found = [_surface(model, poses, geom) for geom in geoms if model.geom_type[geom] != _BOX]
    box = np.array([geom for geom in geoms if model.geom_type[geom] == _BOX], dtype=np.intp)
    if len(box):
        sizes = model.geom_size[box]
        repeat = _repetitions(model, geoms[0], sizes[:, :2])
        found.append(boxes(sizes, poses.positions[box], poses.rotations[box], repeat, shown[box]))
    return joined(found)


def _surface(model: mujoco.MjModel, poses: _Poses, geom: int) -> Surface:
    kind, size = model.geom_type[geom], model.geom_size[geom]
    slices = int(model.vis.quality.numslices)
    if kind == _MESH:
        shape = _mesh_surface(model, int(model.geom_dataid[geom]))
    elif kind == _CYLINDER:
        shape = cylinder(size[0], size[1], slices)
    else:
        shape = capsule(size[0], size[1], slices)
    repeat = _repetitions(model, geom, size[[0, 0]])
    return shape.textured(repeat).placed(poses.positions[geom], poses.rotations[geom])


def _repetitions(model: mujoco.MjModel, geom: int, sizes: Array) -> Array:
    """How often the texture of a geom is repeated over shapes of half sizes (..., 2) in its plane, (..., 2)."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return np.ones_like(sizes)
    repeat = np.broadcast_to(model.mat_texrepeat[material].astype(np.float64), sizes.shape)
    return repeat * sizes if model.mat_texuniform[material] else repeat  # uniform: per metre instead of per shape


def _can_be_merged(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom's triangles are known: of a mesh those without a texture, which would need its coordinates."""
    if model.geom_type[geom] != _MESH:
        return int(model.geom_type[geom]) in _MERGED
    material = int(model.geom_matid[geom])
    return material < 0 or bool((model.mat_texid[material] < 0).all())


def _mesh_surface(model: mujoco.MjModel, index: int) -> Surface:
    """A mesh of the model, with a vertex for each pair of a place and a normal."""
    start, count = int(model.mesh_faceadr[index]), int(model.mesh_facenum[index])
    places = model.mesh_face[start : start + count] + model.mesh_vertadr[index]
    normals = model.mesh_facenormal[start : start + count] + model.mesh_normaladr[index]
    pairs, faces = np.unique(places * np.int64(len(model.mesh_normal)) + normals, return_inverse=True)
    where, facing = np.divmod(pairs, len(model.mesh_normal))
    return Surface(
        model.mesh_vert[where].astype(np.float64),
        model.mesh_normal[facing].astype(np.float64),
        np.zeros((len(pairs), 2)),
        faces.reshape(-1, 3).astype(np.int32),
    )


def _add_mesh(spec: mujoco.MjSpec, surface: Surface, name: str) -> None:
    mesh = spec.add_mesh(name=name)
    mesh.uservert = surface.vertices.ravel()
    mesh.usernormal = surface.normals.ravel()
    mesh.usertexcoord = surface.texcoords.ravel()
    mesh.userface = mesh.userfacenormal = mesh.userfacetexcoord = surface.faces.ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # flat meshes have no volume


def _copied_mesh(spec: mujoco.MjSpec, model: mujoco.MjModel, index: int) -> str:
    name = f"mesh{index}"
    if spec.mesh(name) is not None:
        return name

    def rows(values: NDArray[np.generic], start: NDArray[np.int32], count: NDArray[np.int32]) -> NDArray[np.generic]:
        return values[start[index] : start[index] + count[index]].ravel()

    mesh = spec.add_mesh(name=name)
    mesh.uservert = rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum)
    mesh.usernormal = rows(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum)
    mesh.userface = rows(model.mesh_face, model.mesh_faceadr, model.mesh_facenum)
    mesh.userfacenormal = rows(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum)
    if model.mesh_texcoordadr[index] >= 0:
        mesh.usertexcoord = rows(model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum)
        mesh.userfacetexcoord = rows(model.mesh_facetexcoord, model.mesh_faceadr, model.mesh_facenum)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return name


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


def _matrices(quaternions: Array) -> Array:
    """Rotation matrices (n, 3, 3) of unit quaternions wxyz (n, 4)."""
    w, x, y, z = quaternions.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)
