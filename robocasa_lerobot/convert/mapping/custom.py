"""Mapping files: a robot and its HDF5 layout in a few lines of YAML, for files of unknown kinds (see `EXAMPLE`)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
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
# Of a fixed arm whose data are to be mixed with the mobile robot's: base and mode are said, not recorded.
FIXED_ARM_EXAMPLE = """\
robot_type: PandaOmron
fps: 20
state:
  base_position: {constant: [0, 0, 0]}
  base_rotation: {constant: [0, 0, 0, 1]}
  end_effector_position_relative: obs/eef_pos          # in the frame of the arm's base
  end_effector_rotation_relative: obs/eef_quat         # xyzw
  gripper_qpos: obs/gripper_qpos
action:
  base_motion: {constant: [0, 0, 0, 0]}
  control_mode: {constant: [-1]}                       # the arm moves, not the base
  end_effector_position: {key: actions, slice: [0, 3]}
  end_effector_rotation: {key: actions, slice: [3, 6]}
  gripper_close: {key: actions, slice: [6, 7]}
cameras:
  robot0_agentview_left: obs/left_image
  robot0_agentview_right: obs/right_image
  robot0_eye_in_hand: obs/wrist_image
instruction: {attribute: task}
"""
RENDERED = "render"
ABSOLUTE_SUFFIX = "_absolute"  # of the names of parts that are poses to reach
_KEYS = ("robot_type", "fps", "episodes", "state", "action", "cameras", "instruction")
_PART_KEYS = ("key", "slice", "components", "constant")
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
    recorded = [part for part in action if not part.constant]
    if not recorded:
        raise MappingError("the action has constants only; at least one part needs a `key`.")
    return Layout(
        episodes=_episodes(content.get("episodes", DEFAULT_EPISODES)),
        action_key=recorded[0].key,
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
        MappingError: the robot is called as the benchmark's and lacks one of its parts, or has it in another size.
    """
    state = [_resolved(part, demo, "state") for part in robot.state]
    action = [_resolved(part, demo, "action") for part in robot.action]
    if robot.robot_type == contract.ROBOT_TYPE:  # other data of this robot have these names: they go together then
        state = _as_contract(state, contract.STATE_PARTS, "state")
        action = _as_contract(action, contract.ACTION_PARTS, "action")
    return RobotMapping(
        robot_type=robot.robot_type,
        state_parts=tuple(part for part, _ in state),
        action_parts=tuple(part for part, _ in action),
        state_columns=tuple(columns for _, columns in state),
        action_columns=tuple(columns for _, columns in action),
        default_cameras=robot.cameras,
    )


def _as_contract(
    parts: Sequence[tuple[Part, Columns]], known: Sequence[Part], where: str
) -> list[tuple[Part, Columns]]:
    """The parts with the contract's names of components, in its order where there are no others.

    Raises:
        MappingError: one of the contract is missing, or has another size.
    """
    # A pose to reach stands where the step towards it does.
    found = {part.name.removesuffix(ABSOLUTE_SUFFIX): (_named(part, known), columns) for part, columns in parts}
    for part in known:
        size = found[part.name][0].size if part.name in found else 0
        if size != part.size:
            lack = f"its {part.name} has {size} components" if size else f"it has no part {part.name!r}"
            raise MappingError(
                f"{where} of the mapping: {lack}; {contract.ROBOT_TYPE} has {part.name} of {part.size}. Say what the "
                "robot lacks as `constant`, or give another robot_type."
            )
    if len(parts) == len(known):
        return [found[part.name] for part in known]
    return [(_named(part, known), columns) for part, columns in parts]


def _named(part: Part, known: Sequence[Part]) -> Part:
    """The contract's part of that name and size, with its names of components; else the part itself."""
    return next((other for other in known if (other.name, other.size) == (part.name, part.size)), part)


def _resolved(part: PartColumns, demo: Demo, where: str) -> tuple[Part, Columns]:
    if part.constant:
        size = len(part.constant)
        names = (part.name,) if size == 1 else tuple(f"{part.name}_{i}" for i in range(size))
        return Part(part.name, part.components or names), Columns("", size, 0, size, part.constant)
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
    if "constant" in entry:
        return PartColumns(name, "", components=tuple(components), constant=_constant(entry, where))
    return PartColumns(name, _key(entry.get("key"), f"{where}.key"), start, stop, tuple(components))


def _constant(entry: Mapping[str, Any], where: str) -> tuple[float, ...]:
    numbers = entry["constant"]
    good = isinstance(numbers, list) and numbers and all(type(n) in (int, float) and math.isfinite(n) for n in numbers)
    if not good or "key" in entry or "slice" in entry or len(entry.get("components") or numbers) != len(numbers):
        raise MappingError(
            f"{where}: a constant is a list of numbers, such as [0, 0, 0], and has no key, slice or other number of "
            f"components; found {dict(entry)}."
        )
    return tuple(float(number) for number in numbers)


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
