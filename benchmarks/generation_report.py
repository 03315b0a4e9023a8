"""What attempts at generated demonstrations come to: rates with intervals by task and class, and ratios of arms."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.typical import stages_of
from robocasa_lerobot.wilson import wilson_interval

CLASSES = (
    "buttons, drawers, racks",
    "knobs, levers",
    "doors, lids, heads",
    "pick and place, open surfaces",
    "pick and place, into and out of things",
    "composite",
)
_OF_SKILL = {
    "buttons": 0, "drawers": 0, "racks": 0, "knobs": 1, "levers": 1, "doors": 2,
}  # fmt: skip
_LIDS = ("cover", "uncover")
_CLOSED = ("Cabinet", "Drawer", "Fridge", "Microwave", "Oven", "Toaster", "Blender", "Mixer", "Dishwasher", "Coffee")


@dataclass(frozen=True)
class Trial:
    """An attempt of an arm: `segments` the contacts that it took, `sources` whose they were.

    `success` is the task's goal held to the end, which decides what is kept; `ever` says whether it held at any step,
    by which others count.
    """

    task: str
    seed: int
    arm: str
    success: bool
    ever: bool
    steps: int
    seconds: float
    segments: int
    sources: tuple[int, ...]
    first_try: bool
    reason: str
    commit: str = ""


def class_of(task: str) -> str:
    """Of a task: what its single stage works on."""
    stages = stages_of(get_task(task))
    if len(stages) > 1:
        return CLASSES[5]
    (stage,) = stages
    if stage.skill in _OF_SKILL:
        return CLASSES[_OF_SKILL[stage.skill]]
    if stage.verb in _LIDS:
        return CLASSES[2]
    return CLASSES[4 if any(word in task for word in _CLOSED) else 3]


def summary(trials: Sequence[Trial]) -> dict[str, Any]:
    """Of an arm: each task's and class's rate with its Wilson interval, and why attempts failed."""
    tasks = list(dict.fromkeys(trial.task for trial in trials))
    by_task = {name: _rate([trial for trial in trials if trial.task == name]) for name in tasks}
    by_class: dict[str, Any] = {}
    for group in CLASSES:
        rates = [by_task[name]["rate"] for name in tasks if class_of(name) == group]
        if rates:
            by_class[group] = {"tasks": len(rates), "mean": statistics.mean(rates), "worst": min(rates)}
    means = {"mean": _mean(by_task, "rate"), "mean_ever": _mean(by_task, "ever")}
    return {**means, "classes": by_class, "tasks": by_task}


def _rate(trials: Sequence[Trial]) -> dict[str, Any]:
    kept = [trial for trial in trials if trial.success]
    low, high = wilson_interval(len(kept), len(trials))
    used = Counter(number for trial in kept for number in trial.sources)
    reasons = Counter(trial.reason[:80] for trial in trials if not trial.success)
    return {
        "attempts": len(trials),
        "kept": len(kept),
        "rate": len(kept) / len(trials),
        "ever": sum(trial.ever for trial in trials) / len(trials),
        "wilson_95": [low, high],
        "first_try": sum(trial.first_try for trial in trials) / len(trials),
        "seconds": sum(trial.seconds for trial in trials),
        "most_used_source": max(used.values()) / sum(used.values()) if used else None,
        "failures": dict(reasons.most_common(3)),
    }


def _mean(by_task: dict[str, Any], share: str) -> float | None:
    return statistics.mean(row[share] for row in by_task.values()) if by_task else None


def ratios(trials: Sequence[Trial], workers: int) -> dict[str, float]:
    """Mean rates of arms, what ours keeps beside the others, and kept demonstrations an hour on all workers."""
    arms = list(dict.fromkeys(trial.arm for trial in trials))
    mine = {arm: [trial for trial in trials if trial.arm == arm] for arm in arms}
    means = {arm: summary(mine[arm])["mean"] for arm in arms}
    hourly = {
        arm: 3600.0 * workers * sum(trial.success for trial in rows) / sum(trial.seconds for trial in rows)
        for arm, rows in mine.items()
    }
    out = {f"mean_success_{arm}": mean for arm, mean in means.items()}
    out |= {f"kept_an_hour_{arm}": value for arm, value in hourly.items()}
    for other in ("mimicgen", "scripted"):
        if "ours" in means and means.get(other):
            out[f"success_ours_over_{other}"] = means["ours"] / means[other]
            out[f"kept_an_hour_ours_over_{other}"] = hourly["ours"] / hourly[other]
    return out


def text(trials: Sequence[Trial], head: str) -> str:
    """A page in Markdown: classes and tasks of each arm."""
    lines = ["# Generated attempts", "", head, ""]
    for arm in dict.fromkeys(trial.arm for trial in trials):
        mine = [trial for trial in trials if trial.arm == arm]
        found = summary(mine)
        lines += [f"## {arm}", "", "| class | tasks | mean | worst task |", "|---|--:|--:|--:|"]
        for group, row in found["classes"].items():
            lines.append(f"| {group} | {row['tasks']} | {row['mean']:.0%} | {row['worst']:.0%} |")
        lines += [f"| all | {len(found['tasks'])} | {found['mean']:.1%} | |"]
        lines += [f"| all, the goal at any step | {len(found['tasks'])} | {found['mean_ever']:.1%} | |", ""]
        lines += [
            "| task | kept | rate | 95 % | first try | s an attempt | most used source | fails most with |",
            "|---|--:|--:|---|--:|--:|--:|---|",
        ]
        for name, row in sorted(found["tasks"].items(), key=lambda one: (one[1]["rate"], one[0])):
            low, high = row["wilson_95"]
            most = f"{row['most_used_source']:.0%}" if row["most_used_source"] else ""
            why = next(iter(row["failures"]), "").replace("|", "/")
            lines.append(
                f"| {name} | {row['kept']} of {row['attempts']} | {row['rate']:.0%} | {low:.0%} to {high:.0%} | "
                f"{row['first_try']:.0%} | {row['seconds'] / row['attempts']:.1f} | {most} | {why} |"
            )
        lines.append("")
    return "\n".join(lines)
