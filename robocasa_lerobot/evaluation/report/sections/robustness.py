"""Robustness: what each perturbation costs, on the same kitchens."""

from __future__ import annotations

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Bar, Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, average_of, same_trials
from robocasa_lerobot.evaluation.report.sections.beside_published import beside_table
from robocasa_lerobot.evaluation.statistics.paired import Paired, compare

UNITS = {"m": "m", "deg": "°", "rad": "rad"}


def section(data: ReportData) -> Section | None:
    """None where no policy was tried under more than one condition."""
    policies = _perturbed(data)
    if not policies:
        return None
    text = (
        "Each perturbation is tried on the same kitchens and tasks as the unperturbed trials, so that the drop is of "
        "the perturbation and not of other scenes.",
    )
    parts = [_table(data, policy) for policy in policies]
    beside = beside_table(data, "robustness")
    parts += [beside] if beside is not None else []
    return Section("robustness", "Robustness", text, parts=tuple(parts))


def sentence(data: ReportData) -> str | None:
    """The perturbation that changes the success most, in plain words."""
    policies = _perturbed(data)
    if not policies:
        return None
    policy = policies[-1]
    drops = {name: drop for name in policy.conditions if (drop := _drop(policy, name)) is not None}
    if not drops:
        return None
    if not any(drop.difference.value for drop in drops.values()):
        return f"None of {fmt.count(len(drops), 'perturbation')} changes the success of {policy.label}."
    name, worst = max(drops.items(), key=lambda item: abs(item[1].difference.value))
    return (
        f"Of {fmt.count(len(drops), 'perturbation')}, {spelled(name)} changes the success of {policy.label} most: "
        f"{fmt.points(worst.difference.value)} points (95 % interval {fmt.points_interval(worst.difference)})."
    )


def spelled(name: str) -> str:
    """A perturbation's name for people, the published one where there is one."""
    labels = {column.key: column.label for column in published.table("robustness").columns}
    return labels.get(name, name.replace("_", " "))


def parameter(name: str, value: object) -> str:
    """A parameter with its unit, which its name ends with: `joint_rad` of 0.05 is `joint 0.05 rad`."""
    words, _, unit = name.rpartition("_")
    if unit not in UNITS:
        return f"{name.replace('_', ' ')} {value}"
    return f"{words.replace('_', ' ')} {value}{fmt.NBSP}{UNITS[unit]}"


def _perturbed(data: ReportData) -> list[PolicyResult]:
    return [policy for policy in data.policies if len(policy.conditions) > 1]


def _drop(policy: PolicyResult, condition: str) -> Paired | None:
    if condition == UNPERTURBED or UNPERTURBED not in policy.conditions:
        return None
    trials = same_trials(policy, policy, UNPERTURBED, condition)
    return compare(trials).overall if trials else None


def _table(data: ReportData, policy: PolicyResult) -> Table:
    columns = (
        Column("perturbation"),
        Column("success, mean over tasks", numeric=True, wide=True, series=data.series(policy)),
        Column("change, points", numeric=True),
        Column("p, exact McNemar", numeric=True),
        Column("standard deviations"),
    )
    rows = []
    for name, tasks in policy.conditions.items():
        mean, drop = average_of(tasks), _drop(policy, name)
        parameters = next((h.perturbations[name] for h in policy.headers if name in h.perturbations), {})
        rows.append(
            (
                Cell(spelled(name)),
                Cell(
                    fmt.percent(mean.value), mean.value, fmt.interval(mean), Bar(mean, data.series(policy)), strong=True
                ),
                Cell(fmt.NONE)
                if drop is None
                else Cell(
                    fmt.points(drop.difference.value),
                    100 * drop.difference.value,
                    fmt.points_interval(drop.difference),
                    strong=True,
                ),
                Cell(fmt.NONE) if drop is None else Cell(fmt.p_value(drop.p_value), drop.p_value),
                Cell("; ".join(parameter(key, value) for key, value in parameters.items()) or fmt.NONE),
            )
        )
    return Table(
        f"robustness-{data.series(policy) + 1}",
        f"{policy.label} under each perturbation",
        columns,
        tuple(rows),
        notes=("Changes are against the unperturbed trials with the same seeds; intervals are 95 %.",),
        cards=True,
    )
