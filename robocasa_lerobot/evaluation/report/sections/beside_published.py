"""The benchmark's tables with ours beside the published numbers, and what makes the two incomparable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robocasa_lerobot.evaluation import published
from robocasa_lerobot.evaluation.published import Entry, PublishedTable
from robocasa_lerobot.evaluation.report import format as fmt
from robocasa_lerobot.evaluation.report.gather import PolicyResult, ReportData, average_of
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table

# Target demonstrations per task of the whole benchmark: 100 %.
ALL_DEMOS = 500
TARGET_ONLY = "target only"
SPLITS = {"target": "target scenes", "pretrain": "pretraining scenes"}


def section(data: ReportData) -> Section | None:
    """The group table that fits the run's scenes; None where no policy has half of the tasks of a published group."""
    policies = [policy for policy in data.policies if _covers_a_group(policy)]
    if not policies:
        return None
    table = published.table(table_for(policies))
    text = (
        "The benchmark's groups of tasks. An average weighs every task alike; its interval is for exactly these tasks, "
        "in kitchens drawn like these.",
    )
    return Section("groups", "Groups of tasks, beside published numbers", text, parts=(_table(data, policies, table),))


def table_for(policies: list[PolicyResult]) -> str:
    """Name of the published table whose setting is nearest: by the scenes of the last policy."""
    return "multi_task" if policies[-1].header.split == "pretrain" else "foundation"


def counterpart(policy: PolicyResult, table: PublishedTable) -> Entry | None:
    """The published column that a policy's labels name: with or without pretraining, at the same target data."""
    if policy.info.demo_fraction is None:
        return None
    demos = round(ALL_DEMOS * policy.info.demo_fraction)
    pretrained = (policy.info.training_data or "").strip().lower() != TARGET_ONLY
    for column in table.columns:
        if column.facts.get("target_demos") == demos and column.facts.get("pretrained") is pretrained:
            return column
    return None


def _table(data: ReportData, policies: list[PolicyResult], table: PublishedTable) -> Table:
    columns = (Column("policy"), *(Column(row.label, numeric=True) for row in table.rows))
    matched = {policy.label: counterpart(policy, table) for policy in policies}
    rows = []
    for policy in policies:
        cells = [Cell(policy.label, series=data.series(policy))]
        for row in table.rows:
            tasks = policy.group(row.key)
            if not tasks:
                cells.append(Cell(fmt.NONE))
                continue
            mean, full = average_of(tasks), group_size(row.key)
            some = "" if len(tasks) == full else f" · {len(tasks)} of {full} tasks"
            cells.append(Cell(fmt.percent(mean.value), mean.value, fmt.interval(mean) + some, strong=True))
        rows.append(tuple(cells))
        column = matched[policy.label]
        if column is not None:
            rows.append(_published_row(table, column))
    rows += [_published_row(table, column) for column in table.columns if column not in matched.values()]
    return Table(
        "groups-published",
        f"{table.title}: ours and published success",
        columns,
        tuple(rows),
        notes=(f"Published: {table.source}. {table.notes}",),
        warnings=(published.DIFFERENT_KITCHENS_SHORT, *differences(policies, table.protocol)),
        cards=True,
    )


def _published_row(table: PublishedTable, column: Entry) -> tuple[Cell, ...]:
    cells = [Cell(column.label, muted=True, tag="published")]
    for row in table.rows:
        value = table.value(row.key, column.key)
        cells.append(
            Cell(fmt.NONE, muted=True) if value is None else Cell(fmt.published(value), value / 100, muted=True)
        )
    return tuple(cells)


def _covers_a_group(policy: PolicyResult) -> bool:
    return any(2 * len(policy.group(group)) >= size for group, size in published.GROUPS.items())


def group_size(key: str) -> int:
    """Tasks of a published group; "average" is all of them."""
    return published.GROUPS.get(key, sum(published.GROUPS.values()))


def differences(policies: Sequence[PolicyResult], protocol: Mapping[str, Any]) -> list[str]:
    """Where ours is not the protocol of a published table, a sentence for each difference."""
    found: dict[str, None] = {}
    for policy in policies:
        header, who = policy.header, "ours"
        if header.split != protocol["split"]:
            theirs = SPLITS.get(protocol["split"], protocol["split"])
            found[f"Scenes differ: {who} are {SPLITS.get(header.split, header.split)}, published are {theirs}."] = None
        trials = {result.rate.trials for result in policy.tasks}
        if trials != {protocol["trials_per_task"]}:
            shown = f"{min(trials)} to {max(trials)}" if len(trials) > 1 else str(min(trials))
            found[f"Trials per task differ: {who} {shown}, published {protocol['trials_per_task']}."] = None
        if header.horizon_rule != "task":
            found[f"Horizons differ: {who} are {horizon_phrase(policy)}, published are each task's own."] = None
        elif header.horizon_multiplier != 1.0:
            found[f"Horizons differ: {who} are {header.horizon_multiplier:g} times each task's own."] = None
        if header.success_rule != "any_step" or header.success_hold_steps > 1:
            found[f"Success differs: {who} {success_phrase(policy)}, published at any step."] = None
    return list(found)


def horizon_phrase(policy: PolicyResult) -> str:
    """How long the trials of a policy may last."""
    header = policy.header
    if header.horizon_rule == "fixed":
        lengths = {r.horizon for result in policy.tasks for r in result.trials if r.horizon is not None}
        return f"a fixed horizon of {', '.join(f'{steps:,}' for steps in sorted(lengths))} steps"
    if header.horizon_rule == "env":
        return "the env's own horizon"
    own = "each task's own horizon"
    return own if header.horizon_multiplier == 1 else f"{header.horizon_multiplier:g} times {own}"


def success_phrase(policy: PolicyResult) -> str:
    """When a trial counts as solved."""
    header = policy.header
    if header.success_rule == "hold" or header.success_hold_steps > 1:
        return f"when the goal held for {header.success_hold_steps} steps in a row"
    return (
        "when the goal held at the last step" if header.success_rule == "at_end" else "when the goal held at any step"
    )
