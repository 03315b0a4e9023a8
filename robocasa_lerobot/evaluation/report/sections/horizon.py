"""Success against time: what a shorter or longer horizon would have changed."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.formats.charts import Line, line_chart
from robocasa_lerobot.evaluation.report.model import Cell, Column, Figure, Section, Series, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.evaluation.statistics.horizon import SuccessCurve, success_curve, time_to_success

MAX_LINES = 6
AT = (0.25, 0.5, 0.75, 1.0)
AT_END = "at_end"


def section(data: ReportData) -> Section | None:
    """None where no trial has a horizon, or none succeeded.

    Times of policies whose trials last otherwise are in other units: those of the last policy's kind are shown. Where
    the goal must hold at the end a trial that had it earlier counts as unsolved, so that its time says nothing.
    """
    timed = [p for p in data.policies if p.header.success_rule != AT_END and _times(p)[1]]
    alike = [policy for policy in timed if _is_fixed(policy) == _is_fixed(timed[-1])]
    policies = alike[-MAX_LINES:]
    if not any(result.rate.successes for policy in policies for result in policy.tasks):
        return None
    lines, rows = [], []
    unit = (
        "share of the trial's horizon" if _is_fixed(policies[-1]) else "time, as a multiple of the task's own horizon"
    )
    for policy in policies:
        first, ended = _times(policy)
        curve = success_curve(first, ended)
        # A step curve begins at nothing solved.
        x, y, low, high = (
            np.concatenate([[start], values])
            for start, values in ((0.0, curve.times), (0.0, curve.rate), (0.0, curve.low), (0.0, curve.high))
        )
        grid = np.union1d(np.linspace(0, max(ended), 120), [0.0])
        index = np.searchsorted(x, grid, side="right") - 1
        lines.append(
            Line(
                policy.label,
                data.series(policy),
                tuple(grid),
                tuple(100 * y[index]),
                tuple(100 * low[index]),
                tuple(100 * high[index]),
            )
        )
        seconds = _seconds(policy)
        quartiles = None if seconds is None else time_to_success(seconds)
        times = [fmt.NONE] * 3
        if quartiles is not None:
            times = [fmt.seconds(t) for t in (quartiles.first_quartile, quartiles.median, quartiles.third_quartile)]
        values = [] if quartiles is None else [quartiles.first_quartile, quartiles.median, quartiles.third_quartile]
        rows.append(
            (
                Cell(policy.label),
                *(_solved_by(curve, share, max(ended)) for share in AT),
                *(Cell(t, values[i] if values else None) for i, t in enumerate(times)),
            )
        )
    svg = line_chart(
        "horizon-chart",
        "Success against time",
        f"Share of trials solved by each time, in {unit}, for {fmt.listed([p.label for p in policies])}; the table "
        "below has the numbers.",
        lines,
        unit,
        "solved, % of trials",
        y_range=(0, 100),
    )
    table = Table(
        "horizon-numbers",
        "Share of trials solved by parts of the horizon, and seconds to success",
        (
            Column("policy"),
            *(Column(f"by {share:g}×", numeric=True) for share in AT),
            Column("first quartile", numeric=True),
            Column("median", numeric=True),
            Column("third quartile", numeric=True),
        ),
        tuple(rows),
        notes=("Seconds are simulated, over solved trials only; none where the env does not say how long a step is.",),
    )
    figure = Figure(
        "horizon-figure",
        "Trials solved by each time",
        svg,
        table,
        "All trials together; bands are 95 % intervals (Kaplan-Meier). A curve that still rises at its end says that a "
        "longer horizon would give a higher rate.",
        tuple(Series(line.label, line.series) for line in lines),
    )
    return Section("horizon", "Success against time", _left_out(data, timed, alike, policies), parts=(figure,))


def _solved_by(curve: SuccessCurve, share: float, last: float) -> Cell:
    """Nothing is known of what lies behind the end of all trials."""
    return Cell(fmt.NONE) if share > last else Cell(fmt.percent(curve.at(share)), curve.at(share))


def _left_out(
    data: ReportData, timed: list[PolicyResult], alike: list[PolicyResult], shown: list[PolicyResult]
) -> tuple[str, ...]:
    """Which policies are not in the figure, and why."""
    text = []
    if more := len(alike) - len(shown):
        text.append(f"The last {len(shown)} policies; {more} more are in the tables.")
    if others := [policy.label for policy in timed if policy not in alike]:
        text.append(f"Left out is what has another kind of horizon: {fmt.listed(others)}.")
    if at_end := [policy.label for policy in data.policies if policy.header.success_rule == AT_END]:
        text.append(f"Left out is what must hold at the end of a trial, whenever that is: {fmt.listed(at_end)}.")
    return tuple(text)


def _records(policy: PolicyResult) -> list:
    return [r for result in policy.tasks for r in result.trials if r.horizon]


def _seconds(policy: PolicyResult) -> list[float | None] | None:
    """Time to success of each trial; None where the env does not say how long a step is."""
    out: list[float | None] = []
    for result in policy.tasks:
        if result.seconds is None:
            return None
        out += [seconds for r, seconds in zip(result.trials, result.seconds, strict=True) if r.horizon]
    return out


def _times(policy: PolicyResult) -> tuple[list[float | None], list[float]]:
    """First success and end of each trial as multiples of the task's own horizon (or of the fixed one)."""
    first: list[float | None] = []
    ended = []
    for record in _records(policy):
        own = record.horizon / record.horizon_multiplier
        first.append(None if record.first_success_step is None else record.first_success_step / own)
        ended.append(record.horizon / own)
    return first, ended


def _is_fixed(policy: PolicyResult) -> bool:
    """Whether trials do not last as long as the task's own horizon says, or a multiple of that."""
    return policy.header.horizon_rule != "task"
