"""The demonstrators' rates, times and picture, computed from their trials alone."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import common
from demonstrators_trial import Trial

from robocasa_lerobot import contract
from robocasa_lerobot.benchmark.tasks import facts_of
from robocasa_lerobot.evaluation.statistics.rates import success_rate

# What a finished set of demonstrators is to reach: of atomic tasks the mean and the lowest rate, of composite ones
# too; and seconds over the human median.
AIM_MEAN, AIM_TASK, AIM_TIMES_HUMAN = 0.94, 0.70, 1.5
AIM_MEAN_COMPOSITE, AIM_COMPOSITE = 0.80, 0.40
_SPLITS = {"target": "#1f77b4", "pretrain": "#ff7f0e"}
_REASONS = 3
_WORST = 20  # tasks whose failures are told by stage


def summary(trials: Sequence[Trial], able: Mapping[str, bool]) -> dict[str, Any]:
    """For each task: rate with interval, in all and by split, seconds beside the human's, and why it fails.

    Tasks without a demonstrator, and those that were not tried, have the rate None.
    """
    out: dict[str, Any] = {}
    for name in sorted(able):
        mine = [trial for trial in trials if trial.task == name]
        human = facts_of(name).human_seconds
        entry: dict[str, Any] = {
            "demonstrator": able[name],
            "kind": facts_of(name).kind,
            **_rate(mine),
            "human_seconds": human,
        }
        if mine:
            entry["splits"] = {
                split: _rate(of_split)
                for split in sorted({trial.split for trial in mine})
                if (of_split := [trial for trial in mine if trial.split == split])
            }
            entry |= _seconds([trial for trial in mine if trial.success], human)
            entry["failures"] = dict(Counter(_kind(t) for t in mine if not t.success).most_common(_REASONS))
            entry["failed_at"] = dict(Counter(_place_of(t) for t in mine if not t.success).most_common())
            entry["stages"] = _stages(mine)
            entry["failed_seeds"] = sorted([t.split, t.seed] for t in mine if not t.success)
        out[name] = entry
    return out


def ratios(tasks: Mapping[str, Any]) -> dict[str, Any]:
    """Means over tasks and shares of tasks; None where nothing was tried."""
    rates = [task["success_rate"] for task in tasks.values() if task["success_rate"] is not None]
    by_split = {
        f"mean_success_{split}": [
            t["splits"][split]["success_rate"] for t in tasks.values() if split in t.get("splits", {})
        ]
        for split in _SPLITS
    }
    times = [task["times_human"] for task in tasks.values() if task.get("times_human") is not None]
    return {
        "tasks_with_demonstrator": sum(task["demonstrator"] for task in tasks.values()) / len(tasks),
        "mean_success": statistics.mean(rates) if rates else None,
        "mean_success_counting_missing_as_0": sum(rates) / len(tasks),
        **{name: statistics.mean(values) if values else None for name, values in by_split.items()},
        **{
            f"{name}_{kind}": value for kind in ("atomic", "composite") for name, value in _of_kind(tasks, kind).items()
        },
        "worst_task": min(rates, default=None),
        "tasks_at_least_half": sum(rate >= 0.5 for rate in rates) / len(tasks),
        "tasks_within_1.5_times_human": sum(t <= AIM_TIMES_HUMAN for t in times) / len(tasks),
        "median_times_human": statistics.median(times) if times else None,
    }


def _of_kind(tasks: Mapping[str, Any], kind: str) -> dict[str, float | None]:
    """Mean and lowest rate of the tasks of a kind that were tried."""
    rates = [
        task["success_rate"] for task in tasks.values() if task["kind"] == kind and task["success_rate"] is not None
    ]
    return {"mean_success": statistics.mean(rates) if rates else None, "worst_task": min(rates, default=None)}


def text(body: Mapping[str, Any]) -> str:
    """Tables for the terminal: every task, worst first, and the averages."""
    rows = _rows(body)
    missing = [name for name, task in body["tasks"].items() if not task["demonstrator"]]
    lines = [common.table(_HEADER, rows) if rows else "nothing has been tried yet", ""]
    if rows:
        hourly = body["demonstrations_per_hour"]
        lines += [
            _averages(body),
            f"{hourly['all_processes']:.0f} demonstrations an hour, {hourly['one_process']:.0f} of one process",
        ]
    if missing:
        lines.append(f"no demonstrator: {', '.join(missing)}")
    return "\n".join(lines)


def page(body: Mapping[str, Any], picture: str) -> str:
    """The same for people who read it later: a page in Markdown, with a picture that lies beside it."""
    settings = body["settings"]
    lines = [
        "# Demonstrators",
        "",
        f"`benchmarks/demonstrators.py`, {body['trials']} trials, seeds from {settings['first_seed']} on, "
        f"{settings['seeds_per_split']} in each split, action noise {settings['action_noise']:g}; "
        f"MuJoCo {body['versions']['mujoco']}. Made at "
        + ", ".join(f"{commit} ({count})" for commit, count in body["commits"].items())
        + ".",
        f"In short: {_averages(body)}.",
        "",
        f"![Rates with their intervals]({picture})",
        "",
        "|".join(["", *_HEADER, ""]),
        "|".join(["", "---", *["--:"] * (len(_HEADER) - 2), "---", ""]),
        *("|".join(["", *row, ""]) for row in _rows(body)),
        "",
        "`s`: median of the simulated seconds of the demonstrations that succeeded; `human s`: of human ones.",
        *_worst_page(body),
        *_stages_page(body),
    ]
    return "\n".join(lines) + "\n"


def _worst_page(body: Mapping[str, Any]) -> list[str]:
    """Where the tasks with the lowest rates fail, and why; those that always succeed are left out."""
    tried = [(task["success_rate"], name) for name, task in body["tasks"].items() if task.get("failed_at")]
    rows = [
        f"|{name}|{place}|{count}|"
        for _, name in sorted(tried)[:_WORST]
        for place, count in body["tasks"][name]["failed_at"].items()
    ]
    if not rows:
        return []
    head = ["|task|first stage that was not done, and the reason|failures|", "|---|---|--:|"]
    return ["", f"## Where the worst {min(len(tried), _WORST)} fail", "", *head, *rows]


def _stages_page(body: Mapping[str, Any]) -> list[str]:
    """Per-stage rates of the tasks of several stages."""
    rows = [
        f"|{name}|{number}|{stage['stage']}|{stage['done']}/{stage['reached']}|{stage['attempts_mean'] or '-'}|"
        for name, task in sorted(body["tasks"].items())
        for number, stage in enumerate(task.get("stages", ()), start=1)
    ]
    if not rows:
        return []
    head = ["|task|stage|what|done, of reached|attempts where tried|", "|---|--:|---|--:|--:|"]
    return ["", "## Stages", "", *head, *rows]


_HEADER = ["task", "solved", "rate", "95 %", *_SPLITS, "s", "human s", "most frequent failure"]


def _rows(body: Mapping[str, Any]) -> list[list[str]]:
    """A row of cells for each task that was tried, worst first."""
    tried = {name: t for name, t in body["tasks"].items() if t["success_rate"] is not None}
    return [
        [
            name,
            f"{task['successes']}/{task['trials']}",
            f"{task['success_rate']:.0%}",
            f"{task['low']:.0%}-{task['high']:.0%}",
            *(f"{task['splits'][s]['success_rate']:.0%}" if s in task["splits"] else "-" for s in _SPLITS),
            "-" if task["seconds_median"] is None else f"{task['seconds_median']:.1f}",
            "-" if task["human_seconds"] is None else f"{task['human_seconds']:.0f}",
            next(iter(task["failures"]), "")[:70],
        ]
        for name, task in sorted(tried.items(), key=lambda item: (item[1]["success_rate"], item[0]))
    ]


def _averages(body: Mapping[str, Any]) -> str:
    found, tasks = body["ratios"], body["tasks"]
    quick = round(found["tasks_within_1.5_times_human"] * len(tasks))
    tried = sum(task["success_rate"] is not None for task in tasks.values())
    aims = {"atomic": (AIM_MEAN, AIM_TASK), "composite": (AIM_MEAN_COMPOSITE, AIM_COMPOSITE)}
    parts = []
    for kind, (mean, worst) in aims.items():
        if found[f"mean_success_{kind}"] is None:
            continue
        lowest = f"worst {found[f'worst_task_{kind}']:.0%} (aim {worst:.0%})"
        parts.append(f"{kind} tasks: mean {found[f'mean_success_{kind}']:.1%} (aim {mean:.0%}), {lowest}")
    return (
        f"{'; '.join(parts)}; {tried} tasks were tried, {quick} take at most {AIM_TIMES_HUMAN} times the human median"
    )


def draw(tasks: Mapping[str, Any], path: Path) -> None:
    """A picture of the rates with their intervals, the best task on top; tasks without a demonstrator stand last.

    Tasks with a demonstrator that were not tried are left out: a table may be of some tasks only.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [name for name, task in tasks.items() if task["success_rate"] is not None or not task["demonstrator"]]
    order = sorted(shown, key=lambda name: (_place(tasks[name]), name))
    figure = Figure(figsize=(9, 1.2 + 0.21 * len(order)), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for shift, (split, colour) in zip((0.17, -0.17), _SPLITS.items(), strict=True):
        rows = [
            (y, tasks[name]["splits"][split]) for y, name in enumerate(order) if split in tasks[name].get("splits", {})
        ]
        if rows:
            rates = [r["success_rate"] for _, r in rows]
            spread = [[r["success_rate"] - r["low"] for _, r in rows], [r["high"] - r["success_rate"] for _, r in rows]]
            heights = [y + shift for y, _ in rows]
            axes.errorbar(rates, heights, xerr=spread, fmt="o", ms=4, lw=1.2, color=colour, label=split)
    for y, name in enumerate(order):
        if tasks[name]["success_rate"] is None:
            axes.text(0.01, y, "no demonstrator", va="center", fontsize=7, color="0.5")
    axes.set_yticks(range(len(order)), order, fontsize=7)
    axes.set_ylim(-0.7, len(order) - 0.3)
    axes.set_xlim(0, 1.005)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axes.axvline(AIM_TASK, color="0.7", lw=0.8, ls=":")
    axes.grid(axis="x", color="0.93")
    axes.set_axisbelow(True)
    axes.set_xlabel("success rate of the demonstrator, Wilson 95 % intervals")
    axes.set_title("Demonstrators in kitchens and with seeds that they were not made on", fontsize=10)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower right", fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _place(task: Mapping[str, Any]) -> float:
    rate: float | None = task["success_rate"]
    return rate if rate is not None else -1.0 if task["demonstrator"] else -2.0


def _rate(trials: Sequence[Trial]) -> dict[str, Any]:
    if not trials:
        return {"success_rate": None, "successes": 0, "trials": 0}
    rate = success_rate(sum(trial.success for trial in trials), len(trials))
    return {
        "success_rate": round(rate.rate, 4),
        "low": round(rate.low, 4),
        "high": round(rate.high, 4),
        "successes": rate.successes,
        "trials": rate.trials,
    }


def _stages(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """What came of each stage of a task of several, where all its trials have the same ones and say it."""
    said = [trial.stages for trial in trials if trial.stages]
    if not said or len(said[0]) < 2 or len({tuple(stage[0] for stage in stages) for stages in said}) > 1:
        return []
    out = []
    for column in zip(*said, strict=True):
        tried = [attempts for _, attempts, _, _ in column if attempts]
        out.append(
            {
                "stage": column[0][0],
                "reached": sum(attempts > 0 or skipped for _, attempts, _, skipped in column),
                "done": sum(done for _, _, done, _ in column),
                "attempts_mean": round(statistics.mean(tried), 2) if tried else None,
            }
        )
    return out


def _seconds(solved: Sequence[Trial], human: float | None) -> dict[str, Any]:
    """Simulated seconds of the demonstrations that succeeded."""
    if not solved:
        return {"seconds_median": None, "seconds_max": None, "times_human": None}
    seconds = [trial.steps / contract.CONTROL_HZ for trial in solved]
    median = statistics.median(seconds)
    return {
        "seconds_median": round(median, 2),
        "seconds_max": round(max(seconds), 2),
        "times_human": round(median / human, 3) if human else None,
    }


def _place_of(trial: Trial) -> str:
    """The first stage that a failed trial had not done, counted from 1, and the kind of its failure."""
    undone = (f"{i} {stage}: " for i, (stage, _, done, _) in enumerate(trial.stages, start=1) if not done)
    return next(undone, "all stages done: " if trial.stages else "") + _kind(trial)


def _kind(trial: Trial) -> str:
    """A failure's reason without the numbers, objects and names that make each one different."""
    reason = trial.reason or "the goal does not hold at the end"
    words = ["#" if any(character.isdigit() for character in word) else word for word in reason.split()]
    return " ".join(words)
