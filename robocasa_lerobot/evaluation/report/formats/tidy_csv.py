"""The report's numbers as CSV: one row for each policy, perturbation and task, and one for each average."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report.formats.csv_text import csv_text
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, TaskResult, average_of
from robocasa_lerobot.evaluation.report.published_cells import tasks_of
from robocasa_lerobot.evaluation.statistics import Estimate

COLUMNS = (
    "policy",
    "perturbation",
    "split",
    "task",
    "group",
    "tasks",
    "successes",
    "trials",
    "rate",
    "low",
    "high",
    "errors",
    "median_seconds_to_success",
    "stages",
    "mean_progress",
    "progress_low",
    "progress_high",
    "published_rate",
    "synthetic",
)


def render(data: ReportData) -> str:
    """Rates, progress and ends of intervals lie in [0, 1]; `task` is empty in rows of averages.

    A set that was not run as a whole has no row of its own: the mean of some of its tasks is another number.
    """
    return csv_text(COLUMNS, _rows(data))


def _rows(data: ReportData) -> Iterator[dict[str, object]]:
    for policy in data.single:
        for condition, tasks in policy.conditions.items():
            common: dict[str, object] = {
                "policy": policy.label,
                "perturbation": condition,
                "split": policy.header.split,
                "synthetic": int(bool(policy.header.settings.get("synthetic"))),
            }
            for result in tasks:
                rate, progress = result.rate, result.progress
                known = published.per_task_rates().get(result.task) if condition == UNPERTURBED else None
                yield {
                    **common,
                    "task": result.task,
                    "group": published.group_of_task().get(result.task, ""),
                    "tasks": 1,
                    "successes": rate.successes,
                    "trials": rate.trials,
                    "rate": f"{rate.rate:.6f}",
                    "low": f"{rate.low:.6f}",
                    "high": f"{rate.high:.6f}",
                    "errors": result.errors,
                    "median_seconds_to_success": "" if result.median_seconds is None else result.median_seconds,
                    "published_rate": "" if known is None else known / 100,
                    **({} if progress is None else _progress(result.stages, progress)),
                }
            for group in _groups(policy):
                results = tasks if group == "all" else policy.group(group, condition)
                if results and (group == "all" or _is_whole(policy, group, results)):
                    mean = average_of(results)
                    yield {
                        **common,
                        "group": group,
                        "tasks": len(results),
                        "successes": sum(r.rate.successes for r in results),
                        "trials": sum(r.rate.trials for r in results),
                        "rate": f"{mean.value:.6f}",
                        "low": f"{mean.low:.6f}",
                        "high": f"{mean.high:.6f}",
                        "errors": sum(r.errors for r in results),
                    }


def _progress(stages: int | None, progress: Estimate) -> dict[str, object]:
    return {
        "stages": stages,
        "mean_progress": f"{progress.value:.6f}",
        "progress_low": f"{progress.low:.6f}",
        "progress_high": f"{progress.high:.6f}",
    }


def _is_whole(policy: PolicyResult, group: str, results: tuple[TaskResult, ...]) -> bool:
    """Whether these are all tasks of a published group, or of a set as the benchmark or the run's registry has it."""
    of_benchmark = policy.header.registry is None and group in published_task_sets()
    if group in published.GROUPS or of_benchmark:
        whole = tasks_of(group)
    else:
        sets = [part.get(group, []) for one in policy.headers for part in (one.task_sets, one.missing_by_set)]
        whole = frozenset(task for tasks in sets for task in tasks)
    return {result.task for result in results} >= whole


def _groups(policy: PolicyResult) -> list[str]:
    named = (name for header in policy.headers for name in header.task_sets)
    return list(dict.fromkeys(("all", *published.GROUPS, *named)))
