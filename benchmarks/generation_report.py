"""What attempts at generated demonstrations come to: rates with intervals by task and class, and ratios of arms."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robocasa_lerobot.demos.quality.summary import Square, covered_share
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
    by which others count; `first_try` that no segment and no stage had to be done again; `workers` how many attempts
    ran at once; `start` the square of the floor in which it began, none where its scene could not be made.
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
    workers: int = 1
    start: Square | None = None


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
    means |= {f"mean_{name}": _mean(by_task, name) for name in ("most_used_source", "starts_covered")}
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
        "starts_covered": _covered(trials),
        "failures": dict(reasons.most_common(3)),
    }


def _covered(trials: Sequence[Trial]) -> float | None:
    """Share of the squares of starts in which one was kept; None where no start is known."""
    known = {success: [t.start for t in trials if t.start and t.success is success] for success in (True, False)}
    return covered_share(known[True], known[False]) if any(known.values()) else None


def _mean(by_task: dict[str, Any], share: str) -> float | None:
    there = [row[share] for row in by_task.values() if row[share] is not None]
    return statistics.mean(there) if there else None


def ratios(trials: Sequence[Trial]) -> dict[str, float]:
    """Mean rates of arms, kept demonstrations an hour on all workers, and what ours keeps beside the others.

    Beside another arm only those tasks and seeds count that both have tried.
    """
    mine = {arm: [one for one in trials if one.arm == arm] for arm in dict.fromkeys(trial.arm for trial in trials)}
    out: dict[str, float] = {f"mean_success_{arm}": summary(rows)["mean"] for arm, rows in mine.items()}
    out |= {f"kept_an_hour_{arm}": hourly(rows) for arm, rows in mine.items()}
    for other in ("mimicgen", "scripted"):
        theirs = mine.get(other, [])
        both = {(one.task, one.seed) for one in theirs} & {(one.task, one.seed) for one in mine.get("ours", [])}
        ours, others = (
            [one for one in rows if (one.task, one.seed) in both] for rows in (mine.get("ours", []), theirs)
        )
        if any(one.success for one in others):
            out[f"success_ours_over_{other}"] = summary(ours)["mean"] / summary(others)["mean"]
            out[f"kept_an_hour_ours_over_{other}"] = hourly(ours) / hourly(others)
    return out


def hourly(trials: Sequence[Trial]) -> float:
    """Kept demonstrations an hour, with as many at once as ran: seconds are those of one process."""
    hours = sum(trial.seconds / trial.workers for trial in trials) / 3600.0
    return sum(trial.success for trial in trials) / hours if hours else 0.0


def _overview(arms: Mapping[str, tuple[list[Trial], dict[str, Any]]]) -> list[str]:
    """A line for each arm, from its trials and their summary."""
    lines = ["| arm | tasks | attempts | mean of tasks | kept an hour | first try |", "|---|--:|--:|--:|--:|--:|"]
    for arm, (mine, found) in arms.items():
        lines.append(
            f"| {arm} | {len(found['tasks'])} | {len(mine):,} | {found['mean']:.1%} | {hourly(mine):,.0f} | "
            f"{_mean(found['tasks'], 'first_try'):.1%} |"
        )
    return [*lines, ""]


def text(trials: Sequence[Trial], head: str) -> str:
    """A page in Markdown: classes and tasks of each arm."""
    of_arm = {
        arm: [trial for trial in trials if trial.arm == arm] for arm in dict.fromkeys(trial.arm for trial in trials)
    }
    arms = {arm: (mine, summary(mine)) for arm, mine in of_arm.items()}
    lines = ["# Generated attempts", "", head, "", *_overview(arms)]
    for arm, (_, found) in arms.items():
        lines += [f"## {arm}", "", "| class | tasks | mean | worst task |", "|---|--:|--:|--:|"]
        for group, row in found["classes"].items():
            lines.append(f"| {group} | {row['tasks']} | {row['mean']:.0%} | {row['worst']:.0%} |")
        lines += [f"| all | {len(found['tasks'])} | {found['mean']:.1%} | |"]
        lines += [f"| all, the goal at any step | {len(found['tasks'])} | {found['mean_ever']:.1%} | |", ""]
        if found["mean_starts_covered"] is not None:
            lines += [f"Squares of starts in which one was kept, of all tried: {found['mean_starts_covered']:.0%}.", ""]
        lines += [
            "| task | kept | rate | 95 % | first try | s an attempt | most used source | starts covered "
            "| fails most with |",
            "|---|--:|--:|---|--:|--:|--:|--:|---|",
        ]
        for name, row in sorted(found["tasks"].items(), key=lambda one: (one[1]["rate"], one[0])):
            low, high = row["wilson_95"]
            most, covered = (
                "" if row[key] is None else f"{row[key]:.0%}" for key in ("most_used_source", "starts_covered")
            )
            why = next(iter(row["failures"]), "").replace("|", "/")
            lines.append(
                f"| {name} | {row['kept']} of {row['attempts']} | {row['rate']:.0%} | {low:.0%} to {high:.0%} | "
                f"{row['first_try']:.0%} | {row['seconds'] / row['attempts']:.1f} | {most} | {covered} | {why} |"
            )
        lines.append("")
    return "\n".join(lines)
