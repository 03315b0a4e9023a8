"""The benchmark's tables with ours beside the published numbers, and what makes the two incomparable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.published import Entry, PublishedTable
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.joining import same_training
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.evaluation.report.published_cells import OurCell, our_cells

# Tables whose columns are kinds of policies or of trials, which are rows on the page, in the order there.
TRANSPOSED = (
    "foundation",
    "multi_task",
    "pretraining_composition",
    "scene_diversity",
    "joint_cotraining",
    "low_rank",
)
LONGER_HORIZONS = "1.0.1"  # release of RoboCasa that multiplied them by 1.5
SPLITS = {
    "target": "target scenes",
    "pretrain": "pretraining scenes",
    "pretrain_train": "pretraining scenes, those for training",
    "pretrain_val": "pretraining scenes, those kept for validation",
    "own": "another simulator's own scenes",
}


def section(data: ReportData) -> Section | None:
    """The published tables that policies of the report fill; None where they fill none."""
    found = [table for name in TRANSPOSED if (table := beside_table(data, name)) is not None]
    text = (
        "Each published number with ours beside it, where a policy of this report was trained and evaluated alike. An "
        "average weighs every task alike; its interval is for exactly these tasks, in scenes drawn like these. Where "
        "tasks are missing there is no average, since it would be another number.",
    )
    return Section("beside", "Beside the published tables", text, parts=tuple(found)) if found else None


def counterpart(policy: PolicyResult, table: PublishedTable) -> Entry | None:
    """The published column that a policy stands beside, if there is one."""
    keys = [place.column for place in policy.places if place.table == table.name]
    return next((column for column in table.columns if column.key in keys), None)


def beside_table(data: ReportData, name: str) -> Table | None:
    """A published table with a row for each published column and each of our policies in it; None without ours."""
    cells = our_cells(data, name)
    if not cells:
        return None
    table = published.table(name)
    heads = [Column("ours and published")]
    for row in table.rows:
        heads += [Column(row.label, numeric=True, ours=True), Column(row.label, numeric=True, published=True)]
    rows = []
    for column in table.columns:
        for line in _lines([cell for cell in cells if cell.column == column.key]) or [{}]:
            rows.append(_row(table, column, line))
    policies = list(dict.fromkeys(cell.policy for cell in cells))
    return Table(
        f"beside-{name}",
        f"{table.title}: ours and published success",
        tuple(heads),
        tuple(rows),
        notes=(f"Published: {table.source}. {table.notes}".strip(),),
        warnings=(*other_kitchens(policies), *differences(policies, table.protocol), *other_types(cells)),
        cards=True,
        sortable=False,
    )


def our_cell(cell: OurCell | None) -> Cell:
    """Ours in a cell: the mean with its interval; how many of its tasks were run, where not all were."""
    if cell is None:
        return Cell("")
    if cell.mean is None:
        return Cell(fmt.NONE, None, f"partial: {len(cell.tasks)} of {cell.of} tasks")
    return Cell(fmt.percent(cell.mean.value), cell.mean.value, fmt.interval(cell.mean), strong=True)


def published_cell(value: float | None) -> Cell:
    """A published percentage, or nothing."""
    return Cell("") if value is None else Cell(fmt.published(value), value / 100)


def other_types(cells: Sequence[OurCell]) -> list[str]:
    """A sentence for each kind of policy of ours that is not the published one of its column."""
    found: dict[str, None] = {}
    for cell in cells:
        wanted, own = published.policy_type(cell.table, cell.column), cell.policy.info.type
        if own == wanted == published.GR00T:
            found["Policies differ: ours is GR00T N1.7, which LeRobot has; published is N1.5."] = None
        elif own != wanted:
            found[f"Policies differ: ours of the type {own} stands in the place of {wanted}."] = None
    return list(found)


def _lines(cells: Sequence[OurCell]) -> list[dict[str, OurCell]]:
    """Cells of one published column as rows of the page: those of one training together, two of one place apart."""
    lines: list[dict[str, OurCell]] = []
    for cell in cells:
        for line in lines:
            other = next(iter(line.values())).policy
            if cell.row not in line and (other is cell.policy or same_training(other, cell.policy)):
                line[cell.row] = cell
                break
        else:
            lines.append({cell.row: cell})
    return lines


def _row(table: PublishedTable, column: Entry, line: dict[str, OurCell]) -> tuple[Cell, ...]:
    labels = dict.fromkeys(cell.policy.label for cell in line.values())
    out = [Cell(column.label, interval=f"ours: {fmt.listed(list(labels))}" if labels else "")]
    for row in table.rows:
        out += [our_cell(line.get(row.key)), published_cell(table.value(row.key, column.key))]
    return tuple(out)


def others(data: ReportData) -> Section | None:
    """Groups of tasks of policies that are like none of the published ones; None where there are none."""
    policies = [policy for policy in data.policies if not _stands(policy) and _covers_a_group(policy)]
    if not policies:
        return None
    text = ("Policies that stand in no published table: their groups of tasks, with published numbers for context.",)
    table = published.table(table_for(policies))
    return Section("groups", "Groups of tasks", text, parts=(_table(data, policies, table),))


def _stands(policy: PolicyResult) -> bool:
    tables = (*TRANSPOSED, "robustness")
    return any(place.table in tables for place in policy.places) or policy.info.lifelong_phase is not None


def table_for(policies: list[PolicyResult]) -> str:
    """Name of the published table whose setting is nearest: by the scenes of the last policy."""
    return "multi_task" if policies[-1].header.split.startswith("pretrain") else "foundation"


def _table(data: ReportData, policies: list[PolicyResult], table: PublishedTable) -> Table:
    columns = (Column("policy"), *(Column(row.label, numeric=True) for row in table.rows))
    rows = []
    for policy in policies:
        cells = [Cell(policy.label, series=data.series(policy))]
        for row in table.rows:
            tasks = policy.group(row.key, UNPERTURBED)
            cells.append(
                our_cell(OurCell(table.name, row.key, "", None, policy, tasks, group_size(row.key)))
                if tasks
                else Cell(fmt.NONE)
            )
        rows.append(tuple(cells))
    rows += [_published_row(table, column) for column in table.columns]
    return Table(
        "groups-published",
        f"{table.title}: ours and published success",
        columns,
        tuple(rows),
        notes=(f"Published: {table.source}. {table.notes}",),
        warnings=(*other_kitchens(policies), *differences(policies, table.protocol)),
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
    return any(len(policy.group(group, UNPERTURBED)) == size for group, size in published.GROUPS.items())


def group_size(key: str) -> int:
    """Tasks of a published group; "average" is all of them."""
    return published.GROUPS.get(key, sum(published.GROUPS.values()))


def other_kitchens(policies: Sequence[PolicyResult]) -> tuple[str, ...]:
    """In what other kitchens than the published ones, or in what simulator, policies were tried."""
    ours = any(policy.simulator is None for policy in policies)
    return (*((published.DIFFERENT_KITCHENS_SHORT,) if ours else ()), *simulators(policies))


def published_kitchens(policies: Sequence[PolicyResult]) -> str:
    """The same for a reader who knows nothing yet of where published numbers come from."""
    ours = any(policy.simulator is None for policy in policies)
    theirs = published.DIFFERENT_KITCHENS if ours else f"{published.PUBLISHED_SCENES}."
    return " ".join([theirs, *simulators(policies)])


def simulators(policies: Sequence[PolicyResult]) -> list[str]:
    """A sentence for each simulator that is not ours, with the policies that were tried in it."""
    labels: dict[str, list[str]] = {}
    for policy in policies:
        if policy.simulator is not None:
            labels.setdefault(policy.simulator, []).append(policy.label)
    return [
        f"In the simulator {name} {'was' if len(those) == 1 else 'were'} tried: {fmt.listed(those)}."
        for name, those in labels.items()
    ]


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
        elif header.horizon_version == LONGER_HORIZONS and "horizon_note" in protocol:
            found[f"Horizons differ: {protocol['horizon_note']}"] = None
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
