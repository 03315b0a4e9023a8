"""The robot's cameras: the three of the contract and the extra ones, as RoboCasa places them.

Positions in metres and quaternions wxyz are in the parent body's frame; `fovy` is the vertical field of view in
degrees. Source: RoboCasa 1.0.1 (agentviews and co-training set) and robosuite's Panda (eye in hand).

Two numbers of it are read differently. RoboCasa stores the orientations of the co-training agentviews as Euler
angles; they are quaternions here. And it gives `robot0_agentview_center` no field of view in its table of cameras, so
that MuJoCo's default of 45 degrees holds there; it has the 60 degrees of the other scene cameras here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.bodies import Quat, Vec3
from robocasa_lerobot.errors import UnknownNameError, UserError


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


_LEFT_QUAT: Quat = (0.55623853, 0.29935253, -0.37678665, -0.6775092)
_RIGHT_QUAT: Quat = (0.67750919, 0.37678668, -0.29935256, -0.55623859)
# Turns by 90 degrees about x, -110 (left) or -65 (right) about y, -28 about x, in this order, each in the turned frame.
_COTRAINING_LEFT_QUAT: Quat = (0.49165097, 0.2954137, -0.42189449, -0.70215035)
_COTRAINING_RIGHT_QUAT: Quat = (0.72292757, 0.43437871, -0.27672976, -0.46055565)
_CENTER = CameraSpec(
    "robot0_agentview_center",
    names.SUPPORT,
    (-0.6, 0.0, 1.15),
    (0.6369459, 0.33251855, -0.31992382, -0.61755961),
    fovy=60.0,
)
_FRONT = CameraSpec(
    "robot0_frontview",
    names.SUPPORT,
    (-0.5, 0.0, 0.95),
    (0.60889369, 0.38146779, -0.36739075, -0.59055454),
    fovy=60.0,
)

# Named sets of cameras; every set has the contract's three.
CAMERA_SETS: dict[str, tuple[CameraSpec, ...]] = {
    "default": (
        CameraSpec("robot0_agentview_left", names.SUPPORT, (-0.5, 0.35, 1.05), _LEFT_QUAT, fovy=60.0),
        CameraSpec("robot0_agentview_right", names.SUPPORT, (-0.5, -0.35, 1.05), _RIGHT_QUAT, fovy=60.0),
        CameraSpec("robot0_eye_in_hand", names.HAND, (0.05, 0.0, 0.0), (0.0, 0.707107, 0.707107, 0.0), fovy=75.0),
        _CENTER,
        _FRONT,
    ),
    # The poses and the wrist lens of the real robot, for training on simulated and real data together.
    "cotraining": (
        CameraSpec("robot0_agentview_left", names.SUPPORT, (-0.35, 0.4, 0.85), _COTRAINING_LEFT_QUAT, fovy=65.0),
        CameraSpec("robot0_agentview_right", names.SUPPORT, (-0.35, -0.35, 0.85), _COTRAINING_RIGHT_QUAT, fovy=65.0),
        CameraSpec(
            "robot0_eye_in_hand",
            names.HAND,
            (-0.029, 0.0, 0.05),
            (-0.116144, -0.6975031, 0.6975031, 0.1161439),
            focal_pixel=(606.0, 606.0),
            resolution=(640, 480),
            sensor_size=(5.5, 3.0),
        ),
        _CENTER,
        _FRONT,
    ),
}


def cameras_of_set(camera_set: str) -> tuple[CameraSpec, ...]:
    """The cameras of a set.

    Raises:
        UnknownNameError: there is no camera set of that name.
    """
    if camera_set not in CAMERA_SETS:
        raise UnknownNameError("camera set", camera_set, CAMERA_SETS)
    return CAMERA_SETS[camera_set]


def check_camera_names(names: Sequence[str], camera_set: str = "default") -> tuple[str, ...]:
    """The names of wanted cameras, which must be different ones of a set.

    Raises:
        UnknownNameError: no such camera or set.
        UserError: a name twice, or one string in place of a list of names.
    """
    if isinstance(names, str):
        raise UserError(f"cameras: found the text {names!r}, expected a list of names, such as [{names!r}].")
    known = [camera.name for camera in cameras_of_set(camera_set)]
    for name in names:
        if name not in known:
            raise UnknownNameError("camera", name, known)
    if len(set(names)) < len(names):
        raise UserError(f"cameras: found {list(names)}, expected each camera once.")
    return tuple(names)


def add_cameras(spec: mujoco.MjSpec, camera_set: str = "default") -> None:
    """Add a set of cameras to the robot's bodies in `spec`.

    Raises:
        UnknownNameError: there is no camera set of that name.
    """
    for camera in cameras_of_set(camera_set):
        _write_to_spec(spec.body(camera.parent).add_camera(name=camera.name), camera)


def camera_configs(model: mujoco.MjModel) -> dict[str, dict[str, Any]]:
    """Pose and view of all the robot's cameras in a model, by name, in RoboCasa's form of `cam_configs` (JSON-able).

    Each has `parent_body`, `pos` (metres) and `quat` (wxyz) in that body's frame, and `camera_attribs`: texts as in
    MJCF, `fovy` (degrees) or `focal`, `sensorsize` (metres) and `resolution`. The numbers are complete: applied to
    the same kitchen, the cameras are the same bit for bit.
    """
    configs = {}
    for name in (camera.name for camera in CAMERA_SETS["default"]):
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
