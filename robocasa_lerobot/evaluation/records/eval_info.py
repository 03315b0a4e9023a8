"""Export to LeRobot's `eval_info.json`, the file that `lerobot-eval` writes, for tools that read it."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robocasa_lerobot.evaluation.records.results import Results, TrialRecord, file_name
from robocasa_lerobot.files import write_text


def eval_info(results: Results, label: str) -> dict[str, Any]:
    """The results of one policy in the layout of `lerobot-eval` (LeRobot 0.6.1).

    A trial's reward is 1 for its success, as an episode of ours ends there; a trial that ended in an error counts as a
    failure. Groups are tasks; with perturbations, a task under one of them.
    """
    own = [record for record in results.trials if record.label == label]
    groups: dict[str, list[TrialRecord]] = {}
    for record in own:
        name = record.task if record.perturbation == "none" else f"{record.task}/{record.perturbation}"
        groups.setdefault(name, []).append(record)
    per_task = [
        {"task_group": name, "task_id": 0, "metrics": _metrics(sorted(group, key=lambda record: record.trial))}
        for name, group in groups.items()
    ]
    return {
        "per_task": per_task,
        "per_group": {name: _summary(group) for name, group in groups.items()},
        "overall": _summary(own),
    }


def write_eval_info(results: Results, folder: Path) -> list[Path]:
    """Write `eval_info.json`, or `eval_info_<label>.json` for each of several policies; returns the paths.

    Files of before go that are under another name than these, as when a second policy came into the folder.
    """
    labels = list(dict.fromkeys(record.label for record in results.trials))
    paths = []
    for label in labels:
        path = folder / ("eval_info.json" if len(labels) == 1 else f"eval_info_{file_name(label)}.json")
        write_text(path, json.dumps(eval_info(results, label), indent=2))
        paths.append(path)
    for path in folder.glob("eval_info*.json"):
        if path not in paths:
            path.unlink()
    return paths


def _metrics(records: Sequence[TrialRecord]) -> dict[str, Any]:
    rewards = [float(record.success) for record in records]
    return {
        "sum_rewards": rewards,
        "max_rewards": rewards,
        "successes": [record.success for record in records],
        "video_paths": [record.video for record in records if record.video is not None],
        "predicted_video_paths": [],
    }


def _summary(records: Sequence[TrialRecord]) -> dict[str, Any]:
    rewards = [float(record.success) for record in records]
    seconds = sum(record.seconds.total for record in records)
    count = max(1, len(records))
    return {
        "avg_sum_reward": statistics.fmean(rewards) if rewards else float("nan"),
        "avg_max_reward": statistics.fmean(rewards) if rewards else float("nan"),
        "pc_success": 100.0 * sum(rewards) / count,
        "n_episodes": len(records),
        "eval_s": seconds,
        "eval_ep_s": seconds / count,
        "video_paths": [record.video for record in records if record.video is not None],
    }
