"""Cameras on a robot: as they are mounted, added to a spec, recorded, and given back what was recorded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UnknownNameError, UserError

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]  # wxyz


@dataclass(frozen=True)
class CameraSpec:
    """A camera on the robot: by field of view, or, for a camera modelled on a real one, by its lens.

    Attributes:
        name, parent: of the camera and of the body that carries it.
        pos, quat: metres and wxyz in that body's frame; a camera looks along its own -z, with y up.
        fovy: vertical field of view, degrees; not used for a camera with a lens.
        focal_pixel: focal lengths in pixels of the real sensor, x and y.
        focal_length: the same in metres; one of the two is given.
        resolution: width and height of the real sensor, pixels.
        sensor_size: of the real sensor, in the unit of `focal_length`.
    """

    name: str
    parent: str
    pos: Vec3
    quat: Quat
    fovy: float = 45.0
    focal_pixel: tuple[float, float] | None = None
    focal_length: tuple[float, float] | None = None
    resolution: tuple[int, int] | None = None
    sensor_size: tuple[float, float] | None = None

    @property
    def has_lens(self) -> bool:
        """Whether the view is given by focal lengths and sensor instead of a field of view."""
        return self.sensor_size is not None


def check_camera_names(names: Sequence[str], cameras: Iterable[CameraSpec]) -> tuple[str, ...]:
    """The names of wanted cameras, which must be different ones of those given.

    Raises:
        UnknownNameError: no such camera.
        UserError: a name twice, or one string in place of a list of names.
    """
    if isinstance(names, str):
        raise UserError(f"cameras: found the text {names!r}, expected a list of names, such as [{names!r}].")
    known = [camera.name for camera in cameras]
    for name in names:
        if name not in known:
            raise UnknownNameError("camera", name, known)
    if len(set(names)) < len(names):
        raise UserError(f"cameras: found {list(names)}, expected each camera once.")
    return tuple(names)


def add_cameras(spec: mujoco.MjSpec, cameras: Iterable[CameraSpec]) -> None:
    """Add cameras to the robot's bodies in `spec`."""
    for camera in cameras:
        _write_to_spec(spec.body(camera.parent).add_camera(name=camera.name), camera)


def camera_configs(model: mujoco.MjModel, names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Pose and view of cameras in a model, by name, in RoboCasa's form of `cam_configs` (JSON-able).

    Each has `parent_body`, `pos` (metres) and `quat` (wxyz) in that body's frame, and `camera_attribs`: texts as in
    MJCF, `fovy` (degrees) or `focal`, `sensorsize` (metres) and `resolution`. The numbers are complete: applied to
    the same kitchen, the cameras are the same bit for bit.
    """
    configs = {}
    for name in names:
        camera = model.camera(name)
        if model.cam_sensorsize[camera.id].any():
            attributes = {
                "focal": _text(model.cam_intrinsic[camera.id][:2]),
                "sensorsize": _text(model.cam_sensorsize[camera.id]),
                "resolution": _text(model.cam_resolution[camera.id]),
            }
        else:
            attributes = {"fovy": _text([model.cam_fovy[camera.id]])}
        configs[name] = {
            "parent_body": model.body(int(camera.bodyid[0])).name,
            "pos": camera.pos.tolist(),
            "quat": camera.quat.tolist(),
            "camera_attribs": attributes,
        }
    return configs


def apply_camera_configs(target: mujoco.MjModel | mujoco.MjSpec, configs: Mapping[str, Mapping[str, Any]]) -> None:
    """Give cameras the poses and views of recorded `cam_configs`, ours or RoboCasa's: all of them, or none.

    Cameras that `configs` does not name stay as they are, and so does the view of one without `camera_attribs`.
    A compiled model's poses in `MjData` follow at the next `mj_forward`.

    Raises:
        UnknownNameError: a camera that the target does not have, or an attribute that is not understood.
        UserError: numbers missing or wrong, or a camera on another body.
    """
    if isinstance(target, mujoco.MjModel):
        parents = {target.camera(i).name: target.body(int(target.cam_bodyid[i])).name for i in range(target.ncam)}
    else:
        parents = {camera.name: camera.parent.name for camera in target.cameras}
    cameras = []
    for name, config in configs.items():
        if name not in parents:
            raise UnknownNameError("camera", name, parents, "(in cam_configs)")
        parent = str(config.get("parent_body", parents[name]))
        if parent != parents[name]:
            raise UserError(f"cam_configs: {name} is on body {parent!r}, expected {parents[name]!r}.")
        pos = _numbers(name, "pos", config.get("pos"), 3)
        quat = _numbers(name, "quat", config.get("quat"), 4)
        if not any(quat):
            raise UserError(f"cam_configs: quat of {name}: found zeros, expected a rotation (wxyz).")
        camera = CameraSpec(name, parent, (pos[0], pos[1], pos[2]), (quat[0], quat[1], quat[2], quat[3]))
        attributes = config.get("camera_attribs")
        cameras.append((_with_view(camera, attributes) if attributes else camera, bool(attributes)))
    for camera, view in cameras:
        if isinstance(target, mujoco.MjModel):
            _write_to_model(target, camera, view=view)
        else:
            _write_to_spec(target.camera(camera.name), camera, view=view)


def _with_view(camera: CameraSpec, attributes: Mapping[str, Any]) -> CameraSpec:
    sizes = {"fovy": 1, "focal": 2, "focalpixel": 2, "sensorsize": 2, "resolution": 2}
    values: dict[str, list[float]] = {}
    for key, text in attributes.items():
        if key not in sizes:
            raise UnknownNameError("camera attribute", key, sizes, f"(cam_configs of {camera.name})")
        values[key] = _numbers(camera.name, key, text.split() if isinstance(text, str) else text, sizes[key])
        if min(values[key]) <= 0.0 or values.get("fovy", [1.0])[0] >= 180.0:
            raise UserError(f"cam_configs: {key} of {camera.name}: found {text!r}, which is no camera.")
    if set(values) == {"fovy"}:
        return replace(camera, fovy=values["fovy"][0])
    focal = {"focal", "focalpixel"} & set(values)
    if len(focal) != 1 or set(values) != {*focal, "sensorsize", "resolution"}:
        raise UserError(
            f"cam_configs: camera_attribs of {camera.name}: found {', '.join(sorted(values))}; expected fovy, or "
            "sensorsize, resolution and one of focal and focalpixel."
        )
    width, height = (int(size) for size in values["resolution"])
    camera = replace(camera, sensor_size=_pair(values["sensorsize"]), resolution=(width, height))
    if "focal" in values:
        return replace(camera, focal_length=_pair(values["focal"]))
    return replace(camera, focal_pixel=_pair(values["focalpixel"]))


def _write_to_spec(target: mujoco.MjsCamera, camera: CameraSpec, *, view: bool = True) -> None:
    target.pos, target.quat = camera.pos, camera.quat
    if view:
        target.fovy = camera.fovy
        target.focal_pixel = camera.focal_pixel or (0.0, 0.0)
        target.focal_length = camera.focal_length or (0.0, 0.0)
        target.resolution = camera.resolution or (1, 1)
        target.sensor_size = camera.sensor_size or (0.0, 0.0)


def _write_to_model(model: mujoco.MjModel, camera: CameraSpec, *, view: bool) -> None:
    index = model.camera(camera.name).id
    model.cam_pos[index] = camera.pos
    quat = np.array(camera.quat)
    mujoco.mju_normalize4(quat)  # as MuJoCo's compiler does it: a unit quaternion keeps its bits
    model.cam_quat[index] = quat
    if not view:
        return
    model.cam_fovy[index] = camera.fovy
    model.cam_sensorsize[index] = camera.sensor_size or (0.0, 0.0)
    model.cam_resolution[index] = camera.resolution or (1, 1)
    if camera.sensor_size and camera.resolution:
        focal = camera.focal_length
        if camera.focal_pixel:
            focal = _pair([camera.focal_pixel[i] / camera.resolution[i] * camera.sensor_size[i] for i in range(2)])
        assert focal is not None
        model.cam_intrinsic[index] = (*focal, 0.0, 0.0)
        model.cam_fovy[index] = np.rad2deg(2 * np.arctan(camera.sensor_size[1] / 2 / focal[1]))


def _numbers(camera: str, key: str, values: Any, count: int) -> list[float]:
    found: NDArray[np.float64]
    try:
        found = np.array(values, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        found = np.array([np.nan])
    if found.shape != (count,) or not np.isfinite(found).all():
        raise UserError(f"cam_configs: {key} of {camera}: found {values!r}, expected {count} finite number(s).")
    numbers: list[float] = found.tolist()
    return numbers


def _pair(values: Sequence[float]) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _text(values: Sequence[float]) -> str:
    # Enough digits for the single precision that MuJoCo keeps lenses in; fields of view are in double precision.
    return " ".join(f"{value:.9g}" if isinstance(value, np.float32) else f"{value:.17g}" for value in values)
