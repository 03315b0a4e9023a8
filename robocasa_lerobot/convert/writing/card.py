"""The card of a dataset, `README.md` in its folder: what it is, how it was made, licence, counts, how to load it.

The hub shows it as the dataset's page: `hf upload OWNER/NAME FOLDER --repo-type dataset` publishes both, and
`hf repos tag create OWNER/NAME v3.0 --repo-type dataset` says the version that LeRobot looks for.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py

from robocasa_lerobot import contract
from robocasa_lerobot.jsonl import read_jsonl

CARD = "README.md"
_RECORDS = "meta/robocasa"
_OURS = "apache-2.0"  # of this project: kitchens, objects and demonstrators are its own code
_SHOWN = 40


def write_dataset_card(root: Path, sources: Sequence[Path] = ()) -> None:
    """Write the card of a LeRobotDataset v3.0 from what its own files say; the same bytes for the same dataset.

    Args:
        root: its folder, complete but for the card.
        sources: files that it was made from, asked whether this project's demonstrators recorded them.
    """
    _write(root, bool(sources) and all(recorded_here(source) for source in sources))


def _write(root: Path, ours: bool) -> None:
    info = json.loads((root / "meta/info.json").read_text(encoding="utf-8"))
    record = json.loads((root / _RECORDS / "conversion.json").read_text(encoding="utf-8"))
    episodes = read_jsonl(root / _RECORDS / "episodes.jsonl")
    # Names of sources may hold bytes that are no UTF-8.
    (root / CARD).write_text(_card(info, record, episodes, ours), encoding="utf-8", errors="backslashreplace")


def renew_dataset_card(root: Path) -> None:
    """Write the card of a dataset anew that has one, after its pictures have changed; its licence stays."""
    if (root / CARD).is_file() and (root / _RECORDS / "episodes.jsonl").is_file():
        before = (root / CARD).read_text(encoding="utf-8")
        _write(root, f"license: {_OURS}" in before.split("\n---\n")[0])


def recorded_here(file: Path) -> bool:
    """Whether `robocasa-lerobot demos` recorded an HDF5 file, or what one was exported from: nothing else says how.

    What people drove is theirs to license.
    """
    if not file.is_file() or not h5py.is_hdf5(file):
        return False
    with h5py.File(file) as opened:
        data = opened.get("data")
        settings = json.loads(data.attrs.get("recording_settings", "{}")) if data is not None else {}
        return bool(settings) and settings.get("recorded_by") != "teleop"


def _card(info: dict[str, Any], record: dict[str, Any], episodes: list[dict[str, Any]], ours: bool) -> str:
    seconds = info["total_frames"] / info["fps"]
    tasks = Counter(str(episode.get("task_name")) for episode in episodes)
    cameras = ", ".join(f"{c['name']} ({c['height']}x{c['width']})" for c in record["cameras"])
    files = sorted({Path(str(source.get("file"))).name for source in record.get("sources", [])})
    made = (
        "Simulated demonstrations, recorded by the demonstrators of robocasa-lerobot in its own kitchens."
        if ours
        else "Converted from demonstrations of another source; see there how they were made."
    )
    licence = (
        "Apache 2.0: scenes, objects and motions are made by that project's code; the arm's meshes in the pictures are "
        "those of gymnasium-robotics (MIT)."
        if ours
        else "That of the sources, which the conversion does not know: look it up, and name the authors, before you "
        "publish this."
    )
    # Arms on tables and humanoids are converted, too.
    kitchens = ours or info["robot_type"] == contract.ROBOT_TYPE
    lines = [
        "---",
        f"license: {_OURS if ours else 'other'}",
        "task_categories: [robotics]",
        f"tags: [LeRobot{', robocasa' if kitchens else ''}]",
        "configs: [{config_name: default, data_files: data/*/*.parquet}]",
        "---",
        f"# Demonstrations{' of kitchen tasks' if kitchens else ''}",
        "",
        made,
        "",
        f"- format: LeRobotDataset {info['codebase_version']}, robot {info['robot_type']}, {info['fps']} steps/s",
        f"- {info['total_episodes']:,} episodes, {info['total_frames']:,} steps, {seconds / 60:,.1f} minutes",
        f"- cameras: {cameras}",
        f"- made by robocasa-lerobot {record['robocasa_lerobot_version']}",
        f"- from {', '.join(files[:_SHOWN]) or 'a dataset'}",
        "",
        "| task | episodes |",
        "|---|--:|",
        *(f"| {task} | {count:,} |" for task, count in sorted(tasks.items())),
        "",
        "## Licence and attribution",
        licence,
        *(["Tasks, splits and formats follow RoboCasa365 (https://robocasa.ai), which is to be cited."] * kitchens),
        "",
        "## Loading",
        "```python",
        "from lerobot.datasets.lerobot_dataset import LeRobotDataset",
        'dataset = LeRobotDataset("OWNER/NAME")  # or root="FOLDER"',
        "```",
        "`meta/robocasa/` has every setting of the conversion and what was rejected, `extras/` scenes and states.",
        "",
    ]
    return "\n".join(lines)
