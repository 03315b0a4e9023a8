"""A draft of a mapping file for an inspected HDF5 file: known entries filled in, unknown ones left as comments."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.inspect.hdf5 import DatasetShape, FileReport, is_picture
from robocasa_lerobot.convert.mapping.robot_mapping import Columns, RobotMapping
from robocasa_lerobot.convert.mapping.robots import default_cameras
from robocasa_lerobot.convert.reading.layout import DEFAULT_EPISODES
from robocasa_lerobot.errors import UserError

ASSUMED_FPS = 20
# Datasets that are the robot's own state, by the end of their names.
_STATE = re.compile(
    r"(eef_pos|eef_quat|ee_pos|ee_ori|ee_states?|gripper_qpos|gripper_states?|joint_pos|joint_states?|qpos|proprio|"
    r"(^|/)state)$"
)
# Not states, though they have a row for each step.
_OTHER = re.compile(r"(^|/)(next_obs|action_dict|datagen_info|actions?(_abs)?|rewards?|dones?|src_demo_\w+)(/|$)")
_SIMULATOR_STATE = "states"
_LANGUAGE = re.compile(r"(lang|instruction|task_description|prompt)", re.IGNORECASE)


def draft_mapping(report: FileReport) -> str:
    """The YAML text of a mapping that `convert --mapping` takes.

    Raises:
        UserError: the file has no episodes, or nothing that could be a state.
    """
    layout = report.layout
    if layout is None or not report.lengths:
        raise UserError(f"{report.file} has no usable episodes (groups with a dataset `actions`): nothing to draft.")
    lines = [f"# Draft for {Path(report.file).name}: check every line, above all robot_type, fps and instruction."]
    if report.mapping is not None:
        lines.append("# The robot is recognised: without this mapping its state is read, or computed from the scene.")
    lines.append(f"robot_type: {_quoted(_robot_type(report))}")
    known = report.fps is not None and not report.fps_is_assumed
    fps = report.fps or ASSUMED_FPS
    lines.append(f"fps: {fps}" + ("" if known else "  # assumed: steps per second of the recording"))
    if layout.episodes != DEFAULT_EPISODES:
        lines.append(f"episodes: {_quoted(layout.episodes)}")
    states = _states(report)
    lines += ["state:", *(_part(name, fields) for name, fields in states.items())]
    used = {fields["key"] for fields in states.values()}
    lines += [
        f"  # {_name(key, {})}: {_flow({'key': key})}  # {found.shape} {found.dtype}"
        for key, found in report.datasets.items()
        if key not in used and _is_column(report, key, found)
    ]
    lines += ["action:", *(_part(name, fields) for name, fields in _actions(report).items())]
    lines += ["cameras:", *_cameras(report)]
    lines += _instruction(report)
    return "\n".join(lines) + "\n"


def _robot_type(report: FileReport) -> str:
    mapping = report.mapping
    # A mapping that calls its robot as the benchmark's needs all parts of that robot.
    if mapping is None or (mapping.robot_type == contract.ROBOT_TYPE and not _records_state(report, mapping)):
        return "unknown"
    return mapping.robot_type


def _records_state(report: FileReport, mapping: RobotMapping) -> bool:
    return all(columns.key in report.datasets for columns in mapping.state_columns)


def _states(report: FileReport) -> dict[str, dict[str, Any]]:
    mapping = report.mapping
    if mapping is not None and _records_state(report, mapping):
        return _mapped(mapping.state_parts, mapping.state_columns)
    found: dict[str, dict[str, Any]] = {}
    for key, shape in report.datasets.items():
        if _is_column(report, key, shape) and _STATE.search(key) and key != _SIMULATOR_STATE:
            found[_name(key, found)] = {"key": key}
    if not found and _SIMULATOR_STATE in report.datasets:
        found["simulator_state"] = {"key": _SIMULATOR_STATE}
    if not found:
        for key, shape in report.datasets.items():
            if _is_column(report, key, shape):
                found[_name(key, found)] = {"key": key}
    if not found:
        raise UserError(f"{report.file} has no dataset of numbers beside the actions: nothing to take as a state.")
    return found


def _actions(report: FileReport) -> dict[str, dict[str, Any]]:
    assert report.layout is not None
    if report.mapping is not None:
        return _mapped(report.mapping.action_parts, report.mapping.action_columns)
    return {"action": {"key": report.layout.action_key}}


def _mapped(parts: tuple[Part, ...], columns: tuple[Columns, ...]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for part, where in zip(parts, columns, strict=True):
        found[part.name] = {"key": where.key}
        if (where.start, where.stop) != (0, where.width):
            found[part.name]["slice"] = [where.start, where.stop]
        found[part.name]["components"] = list(part.components)
    return found


def _cameras(report: FileReport) -> list[str]:
    lines = []
    names: dict[str, Any] = {}
    for key in report.cameras:
        if "next_obs" in key:
            continue
        name = _name(re.sub(r"_(image|rgb)$", "", key), names)
        names[name] = key
        lines.append(f"  {name}: {_quoted(key)}")
    if not lines:
        lines = [
            f"  {_quoted(camera)}: render  # from model_file and states"
            for camera in default_cameras(report.scene_cameras)
        ]
    lines += [
        f"  # {key} is {found.shape} {found.dtype}, expected (T, H, W, 3) uint8"
        for key, found in report.datasets.items()
        if len(found.shape) == 4 and not is_picture(found) and "image" in key
    ]
    if not names and not report.scene_cameras:
        raise UserError(f"{report.file} has neither pictures (T, H, W, 3) uint8 nor a scene with cameras.")
    return lines


def _instruction(report: FileReport) -> list[str]:
    if any(source != "environment name" for source in report.instruction_sources):
        return ["# instruction: recorded in the file, and taken from there"]
    for where in (report.episode_attributes, report.attributes):
        for name, value in where.items():
            if _LANGUAGE.search(name):
                return ["instruction:", f"  attribute: {_quoted(name)}"]
            field = _language_field(value)
            if field is not None:
                return ["instruction:", f"  attribute: {_quoted(name)}", f"  field: {_quoted(field)}"]
    for key, found in report.datasets.items():
        if _LANGUAGE.search(key) and found.dtype.startswith(("object", "|S", "S")):
            return ["instruction:", f"  dataset: {_quoted(key)}"]
    text = next(iter(report.instructions)) if report.instruction_sources else _words(Path(report.file).stem)
    origin = "the environment's name" if report.instruction_sources else "the file's name"
    return [f"instruction: {_quoted(text)}  # {origin}: say what the robot was told"]


def _language_field(value: Any) -> str | None:
    try:
        content = json.loads(value) if isinstance(value, str) else None
    except json.JSONDecodeError:
        return None
    fields = content if isinstance(content, dict) else {}
    return next((key for key, text in fields.items() if _LANGUAGE.search(key) and text), None)


def _is_column(report: FileReport, key: str, found: DatasetShape) -> bool:
    assert report.layout is not None
    return (
        0 < len(found.shape) < 3
        and found.shape[0] == report.lengths[0]
        and re.fullmatch(r"(float|int|uint)\d+|bool", found.dtype) is not None
        and key != report.layout.action_key
        and not _OTHER.search(key)
        and found.episodes == max(shape.episodes for shape in report.datasets.values())
    )


def _name(key: str, taken: dict[str, Any]) -> str:
    last = re.sub(r"\W", "_", key.rpartition("/")[2])
    return last if last not in taken else re.sub(r"\W", "_", key)


def _words(name: str) -> str:
    return " ".join(re.findall(r"[^\W_]+", name)) or name


def _part(name: str, fields: dict[str, Any]) -> str:
    return f"  {_quoted(name)}: {_flow(fields)}"


def _flow(fields: dict[str, Any]) -> str:
    return yaml.safe_dump(fields, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True).strip()


def _quoted(text: str) -> str:
    return yaml.safe_dump(text, default_flow_style=True, width=10_000, allow_unicode=True).splitlines()[0]
