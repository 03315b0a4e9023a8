"""What a folder with a LeRobot dataset (v2.0, v2.1 or v3.0) says of itself, and what of that is not there."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from robocasa_lerobot.convert.reading.inputs import INFO_FILE
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

# Where `convert` keeps its own records (its pipeline imports LeRobot, which takes seconds).
_RECORDS = "meta/robocasa"
_SHOWN = 10


def inspect_dataset(root: Path) -> dict[str, Any]:
    """Version, robot, rate, counts, features, episodes' lengths, tasks, missing videos, and our records of a dataset.

    Raises:
        UserError: its metadata cannot be read.
    """
    try:
        info = json.loads((root / INFO_FILE).read_text(encoding="utf-8"))
        features = dict(info["features"])
        report = {
            "dataset": str(root),
            "codebase_version": str(info.get("codebase_version", "unknown")),
            "robot_type": info.get("robot_type"),
            "fps": info.get("fps"),
            "episodes": info.get("total_episodes"),
            "frames": info.get("total_frames"),
            "features": {key: [feature.get("dtype"), feature.get("shape")] for key, feature in features.items()},
            "lengths": _lengths(root),
            "tasks": _tasks(root),
            "videos": {
                key: len(list(root.glob(f"videos/**/{key}/**/*.mp4")))
                for key, feature in features.items()
                if feature.get("dtype") == "video"
            },
        }
        report["extras"] = len(list((root / "extras").glob("episode_*"))) if (root / "extras").is_dir() else 0
        record = root / _RECORDS / "conversion.json"
        if record.is_file():
            conversion = json.loads(record.read_text(encoding="utf-8"))
            report["converted_from"] = [source["file"] for source in conversion.get("sources", [])]
            report["rejected"] = len(_json_lines(root / _RECORDS / "rejected.jsonl"))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(f"{root}: its metadata cannot be read ({type(error).__name__}: {error}).") from None
    return report


def describe_dataset(report: dict[str, Any]) -> str:
    """The report for reading."""
    lines = [f"{report['dataset']}: LeRobot dataset {report['codebase_version']}"]
    lengths = report["lengths"]
    spread = f" of {min(lengths)} to {max(lengths)}" if lengths else ""
    lines.append(f"episodes: {report['episodes']}{spread}, {report['frames']} frames at {report['fps']} Hz")
    lines.append(f"robot: {report['robot_type']}")
    lines.append("features:")
    for key, (dtype, shape) in report["features"].items():
        files = report["videos"].get(key)
        note = "" if files is None else f"  ({files} video files)" if files else "  (declared, but has no files)"
        lines.append(f"  {key}  {tuple(shape or ())} {dtype}{note}")
    tasks = report["tasks"]
    lines.append(f"tasks: {len(tasks)}")
    lines += [f"  {task}" for task in tasks[:_SHOWN]]
    lines += [f"  ... and {len(tasks) - _SHOWN} more"] if len(tasks) > _SHOWN else []
    lines.append(f"kept for replaying (extras): {report['extras']} episodes")
    if "converted_from" in report:
        lines.append(f"converted from: {', '.join(report['converted_from'])} ({report['rejected']} episodes rejected)")
    return "\n".join(lines)


def _lengths(root: Path) -> list[int]:
    old = root / "meta" / "episodes.jsonl"
    if old.is_file():
        return [int(line["length"]) for line in _json_lines(old)]
    files = sorted((root / "meta" / "episodes").glob("*/*.parquet"))
    return [int(length) for file in files for length in pq.read_table(file, columns=["length"])["length"].to_pylist()]


def _tasks(root: Path) -> list[str]:
    old = root / "meta" / "tasks.jsonl"
    if old.is_file():
        return list(Counter(str(line["task"]) for line in _json_lines(old)))
    table = pq.read_table(root / "meta" / "tasks.parquet")
    key = next((name for name in table.column_names if name != "task_index"), None)
    return [str(task) for task in table[key].to_pylist()] if key is not None else []


def _json_lines(file: Path) -> list[dict[str, Any]]:
    return read_jsonl(file) if file.is_file() else []
