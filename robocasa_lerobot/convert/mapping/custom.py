"""Mapping files: a robot and its HDF5 layout in a few lines of YAML, for files of unknown kinds (see `EXAMPLE`)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.mapping.robot_mapping import Columns, RobotMapping
from robocasa_lerobot.convert.reading.demo import Demo, SourceError
from robocasa_lerobot.convert.reading.layout import (
    DEFAULT_EPISODES,
    FLIPS,
    CustomRobot,
    InstructionSource,
    Layout,
    PartColumns,
    Picture,
)
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import load_yaml

# In the documentation, and what a test parses.
EXAMPLE = """\
robot_type: ALOHA
fps: 50
episodes: /                     # the file is one episode; default data/demo_*
state:
  arms: {key: observations/qpos, slice: [0, 14]}
action:
  arms: {key: action}
cameras:
  top: observations/images/top
  wrist: {key: observations/images/wrist, flip: vertical}
  overview: render              # not stored: from model_file and states
instruction: put the lid onto the cup
"""
RENDERED = "render"
_KEYS = ("robot_type", "fps", "episodes", "state", "action", "cameras", "instruction")
_PART_KEYS = ("key", "slice", "components")
_CAMERA_KEYS = ("key", "flip")
_INSTRUCTION_KEYS = ("text", "attribute", "field", "dataset")


class MappingError(UserError):
    """A mapping file that says something impossible, or not enough."""


def read_mapping(path: Path) -> str:
    """The content of a mapping file as one line of JSON, checked: what settings and records hold.

    Raises:
        UserError: no such file, not YAML, an unknown or missing key, or an impossible value.
    """
    content = load_yaml(path)
    try:
        text = json.dumps(content, ensure_ascii=False)
    except TypeError as error:
        raise MappingError(f"{path}: {error}; keys are text and values text, numbers or lists.") from None
    try:
        parse_mapping(text)
    except UserError as error:
        raise MappingError(f"{path}: {error}") from None
    return text


@lru_cache(maxsize=8)
def parse_mapping(text: str) -> Layout:
    """The layout that the JSON text of a mapping file describes.

    Raises:
        UserError: an unknown or missing key, or an impossible value.
    """
    content = _mapping(json.loads(text), "the mapping", _KEYS)
    missing = [key for key in ("robot_type", "fps", "state", "action", "cameras") if not content.get(key)]
    if missing:
        raise MappingError(f"the mapping has no {missing[0]!r}; {', '.join(_KEYS[:2])}, state, action, cameras needed.")
    fps = content["fps"]
    if not isinstance(fps, int) or isinstance(fps, bool) or fps < 1:
        raise MappingError(f"fps is {fps!r}, expected a positive whole number of steps per second.")
    state = _parts(content["state"], "state")
    action = _parts(content["action"], "action")
    cameras = _mapping(content["cameras"], "cameras")
    pictures = tuple(
        (str(name), _picture(value, f"cameras.{name}")) for name, value in cameras.items() if value != RENDERED
    )
    return Layout(
        episodes=_episodes(content.get("episodes", DEFAULT_EPISODES)),
        action_key=action[0].key,
        pictures=pictures,
        robot=CustomRobot(
            robot_type=_text(content["robot_type"], "robot_type"),
            fps=fps,
            state=state,
            action=action,
            cameras=tuple(map(str, cameras)),
            instruction=_instruction(content.get("instruction")),
        ),
    )


def custom_mapping(robot: CustomRobot, demo: Demo) -> RobotMapping:
    """The mapping of a described robot, its sizes taken from one demo.

    Raises:
        UnknownNameError: the demo has no dataset of a key.
        SourceError: a slice is longer than its dataset, or component names are not as many as components.
    """
    state = [_resolved(part, demo, "state") for part in robot.state]
    action = [_resolved(part, demo, "action") for part in robot.action]
    return RobotMapping(
        robot_type=robot.robot_type,
        state_parts=tuple(part for part, _ in state),
        action_parts=tuple(part for part, _ in action),
        state_columns=tuple(columns for _, columns in state),
        action_columns=tuple(columns for _, columns in action),
        default_cameras=robot.cameras,
    )


def _resolved(part: PartColumns, demo: Demo, where: str) -> tuple[Part, Columns]:
    values = demo.column(part.key)
    if values is None:
        known = [path for path, (shape, _) in demo.shapes().items() if len(shape) < 4]
        raise UnknownNameError("dataset", part.key, known, f"({where}.{part.name} of the mapping, {demo.name})")
    width = values.shape[1]
    stop = width if part.stop is None else part.stop
    if stop > width:
        raise SourceError(
            f"{where}.{part.name} of the mapping takes numbers {part.start} to {stop} of {part.key}, which has {width}."
        )
    size = stop - part.start
    if part.components and len(part.components) != size:
        raise SourceError(f"{where}.{part.name} of the mapping names {len(part.components)} components for {size}.")
    default = (part.name,) if size == 1 else tuple(f"{part.name}_{i}" for i in range(size))
    return Part(part.name, part.components or default), Columns(part.key, width, part.start, stop)


def _parts(value: Any, where: str) -> tuple[PartColumns, ...]:
    return tuple(_part(str(name), entry, f"{where}.{name}") for name, entry in _mapping(value, where).items())


def _part(name: str, value: Any, where: str) -> PartColumns:
    entry = {"key": value} if isinstance(value, str) else _mapping(value, where, _PART_KEYS)
    start, stop = 0, None
    if "slice" in entry:
        bounds = entry["slice"]
        if (
            not isinstance(bounds, list)
            or len(bounds) != 2
            or not all(isinstance(bound, int) and not isinstance(bound, bool) for bound in bounds)
            or not 0 <= bounds[0] < bounds[1]
        ):
            raise MappingError(f"{where}.slice is {bounds!r}, expected [first, last + 1], such as [0, 3].")
        start, stop = bounds
    components: Any = entry.get("components", [])
    if not isinstance(components, list) or not all(isinstance(c, str) and c for c in components):
        raise MappingError(f"{where}.components is {components!r}, expected a list of names.")
    return PartColumns(name, _key(entry.get("key"), f"{where}.key"), start, stop, tuple(components))


def _picture(value: Any, where: str) -> Picture:
    entry = {"key": value} if isinstance(value, str) else _mapping(value, where, _CAMERA_KEYS)
    flip = entry.get("flip", FLIPS[0])
    if flip not in FLIPS:
        raise UnknownNameError("flip", str(flip), FLIPS, f"({where})")
    return Picture(_key(entry.get("key"), f"{where}.key"), flip)


def _instruction(value: Any) -> InstructionSource:
    if value is None:
        return InstructionSource()
    entry = {"text": value} if isinstance(value, str) else _mapping(value, "instruction", _INSTRUCTION_KEYS)
    fields = {key: _text(text, f"instruction.{key}") for key, text in entry.items()}
    if "field" in fields and "attribute" not in fields:
        raise MappingError("instruction.field is the field of a JSON attribute: instruction.attribute is missing.")
    return InstructionSource(**fields)


def _episodes(value: Any) -> str:
    text = _text(value, "episodes")
    if text == "/":
        return text
    where, _, last = text.strip("/").rpartition("/")
    if not last or "*" in where or ".." in text.split("/"):
        raise MappingError(f"episodes is {text!r}, expected such as data/demo_*, with * in the last name only, or /.")
    return text


def _key(value: Any, where: str) -> str:
    text = _text(value, where)
    if text.startswith("/") or any(piece in ("", ".", "..") for piece in text.split("/")):
        raise MappingError(f"{where} is {text!r}, expected a path below an episode, such as obs/robot0_eef_pos.")
    return text


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise MappingError(f"{where} is {value!r}, expected some text.")
    return value


def _mapping(value: Any, where: str, keys: tuple[str, ...] = ()) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not value:
        raise MappingError(f"{where} is {value!r}, expected names with values.")
    for key in value:
        if keys and key not in keys:
            raise UnknownNameError("key", str(key), keys, f"({where})")
    return value
