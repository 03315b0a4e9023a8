"""Cameras of recorded scenes, moved or added by a description in RoboCasa's `cam_configs` form.

For each camera: `pos` (metres) and `quat` (wxyz) in the frame of the body `parent_body`, and `camera_attribs` as MJCF
has them: `fovy` in degrees, or `focal`/`focalpixel`, `sensorsize` and `resolution`. Missing keys stay as they are.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.errors import UnknownNameError, UserError, suggest
from robocasa_lerobot.settings import load_yaml

CameraConfigs = dict[str, dict[str, Any]]
_KEYS = ("parent_body", "pos", "quat", "camera_attribs")
_LENS = ("focal", "focalpixel", "sensorsize", "resolution", "principal", "principalpixel")
_ATTRIBUTES = {"fovy": 1, "focal": 2, "focalpixel": 2, "sensorsize": 2, "resolution": 2}
_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_SETS = Path(__file__).with_name("camera_sets")


def camera_set(name: str) -> CameraConfigs:
    """A set of cameras that the project has: a file of `camera_sets/`.

    Raises:
        UnknownNameError: there is none of that name.
    """
    known = [file.stem for file in _SETS.glob("*.yaml")]
    if name not in known:
        raise UnknownNameError("camera set", name, known, "(or describe cameras with --cam-configs FILE)")
    return read_camera_configs(_SETS / f"{name}.yaml")


def read_camera_configs(file: Path) -> CameraConfigs:
    """Cameras of a YAML or JSON file; an episode's whole `ep_meta.json` will do, too.

    Raises:
        UserError: no such file, or something in it that is no camera.
    """
    content = load_yaml(file)
    content = content.get("cam_configs", content)
    if not isinstance(content, Mapping) or not content:
        raise UserError(f"{file}: expected cameras by name, each with pos, quat and so on; found {content!r}.")
    return check_camera_configs(content, str(file))


def check_camera_configs(content: Mapping[str, Any], where: str = "cam_configs") -> CameraConfigs:
    """Cameras with all numbers as lists.

    Raises:
        UserError: something in it is no camera; the message begins with `where`.
    """
    return {str(name): _checked(f"{where}: camera {name}", config) for name, config in content.items()}


def with_cameras(xml: str, configs: Mapping[str, Mapping[str, Any]]) -> str:
    """The MJCF with cameras moved and added.

    Raises:
        RejectedEpisodeError: it is no XML, or has no body of that name; a new camera has no body or pose.
    """
    if not configs:
        return xml
    if "<!DOCTYPE" in xml or "<!ENTITY" in xml:
        raise RejectedEpisodeError("its model_file declares XML entities.")
    try:
        root = ET.fromstring(xml)
    except ET.ParseError as error:
        raise RejectedEpisodeError(f"its model_file is not XML ({error}).") from None
    parents = {child: parent for parent in root.iter() for child in parent if child.tag == "camera"}
    cameras = {camera.get("name"): camera for camera in parents}
    bodies = {body.get("name", ""): body for body in root.iter("body")} | {"world": root.find("worldbody")}
    for name, config in configs.items():
        camera = cameras.get(name)
        if camera is None:
            missing = [key for key in ("parent_body", "pos", "quat") if key not in config]
            if missing:
                raise RejectedEpisodeError(
                    f"its scene has no camera {name!r}, and the description of a new one lacks {', '.join(missing)}. "
                    + suggest(name, filter(None, cameras))
                )
            camera = ET.Element("camera", {"name": name})
        _set(camera, config)
        if "parent_body" in config:
            body = bodies.get(config["parent_body"])
            if body is None:
                raise RejectedEpisodeError(
                    f"its scene has no body {config['parent_body']!r} for the camera {name!r}. "
                    + suggest(config["parent_body"], bodies)
                )
            if camera in parents:
                parents[camera].remove(camera)
            body.append(camera)
    return ET.tostring(root, encoding="unicode")


def _set(camera: ET.Element, config: Mapping[str, Any]) -> None:
    if "pos" in config:
        camera.set("pos", _text(config["pos"]))
    if "quat" in config:
        for attribute in (*_ORIENTATIONS, "mode", "target"):
            camera.attrib.pop(attribute, None)
        camera.set("quat", _text(config["quat"]))
    attributes = config.get("camera_attribs", {})
    if attributes:  # a view is given by its angle or by its lens: MuJoCo refuses both
        for attribute in ("fovy", *_LENS):
            camera.attrib.pop(attribute, None)
        for key, values in attributes.items():
            numbers = [int(value) for value in values] if key == "resolution" else values
            camera.set(key, _text(numbers))


def _checked(where: str, config: Any) -> dict[str, Any]:
    if not isinstance(config, Mapping):
        raise UserError(f"{where}: expected {', '.join(_KEYS)}; found {config!r}.")
    for key in config:
        if key not in _KEYS:
            raise UnknownNameError("key", str(key), _KEYS, f"({where})")
    out: dict[str, Any] = {}
    for key, count in (("pos", 3), ("quat", 4)):
        if key in config:
            out[key] = _numbers(where, key, config[key], count)
    if "quat" in out and not any(out["quat"]):
        raise UserError(f"{where}: quat is zero, expected a rotation (wxyz).")
    if "parent_body" in config:
        out["parent_body"] = str(config["parent_body"])
    attributes = config.get("camera_attribs") or {}
    if not isinstance(attributes, Mapping):
        raise UserError(f"{where}: camera_attribs is {attributes!r}, expected names and numbers.")
    for key in attributes:
        if key not in _ATTRIBUTES:
            raise UnknownNameError("camera attribute", str(key), _ATTRIBUTES, f"({where})")
    if attributes:
        view = {key: _numbers(where, key, value, _ATTRIBUTES[key]) for key, value in attributes.items()}
        _check_view(where, view)
        out["camera_attribs"] = view
    return out


def _check_view(where: str, view: Mapping[str, list[float]]) -> None:
    if min(min(values) for values in view.values()) <= 0 or view.get("fovy", [1.0])[0] >= 180:
        raise UserError(f"{where}: camera_attribs {dict(view)} is no camera: positive numbers, fovy below 180.")
    focal = {"focal", "focalpixel"} & set(view)
    if set(view) != {"fovy"} and (len(focal) != 1 or set(view) != {*focal, "sensorsize", "resolution"}):
        raise UserError(
            f"{where}: camera_attribs has {', '.join(sorted(view))}; expected fovy, or sensorsize, resolution and one "
            "of focal and focalpixel."
        )


def _numbers(where: str, key: str, value: Any, count: int) -> list[float]:
    items = value.split() if isinstance(value, str) else value if isinstance(value, list | tuple) else [value]
    try:
        numbers = [float(item) for item in items]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        raise UserError(f"{where}: {key} is {value!r}, expected {count} finite number(s).")
    return numbers


def _text(values: list[float] | list[int]) -> str:
    return " ".join(f"{value:.17g}" for value in values)
