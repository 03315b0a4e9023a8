"""The summary: what was run, what came out, how sure that is, and how it compares, in plain sentences."""

from __future__ import annotations

from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report import comparable, left_out
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Bar, Card, Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, describe_policy
from robocasa_lerobot.evaluation.report.sections import (
    beside_published,
    comparison,
    data_efficiency,
    failures,
    lifelong,
    robustness,
)

# With more policies than this, a table on one scale says more than cards.
MAX_CARDS = 4


def section(data: ReportData) -> Section:
    """A card for each policy, or a table of them, and the sentences."""
    special = special_sentence(data)
    sentences = (
        ("Run", what_was_run(data)),
        ("Partial", left_out.partial_runs(data)),
        ("Left out", left_out.sentence(data)),
        ("Comparison", comparison.sentence(data) if special is None or len(data.policies) == 2 else None),
        ("Certainty", how_sure(data)),
        ("Published", beside(data)),
        ("Failures", failures.sentence(data)),
        ("Errors", errors(data)),
    )
    few = len(data.policies) <= MAX_CARDS
    return Section(
        "summary",
        "Summary",
        sentences=tuple((name, text) for name, text in sentences if text),
        cards=tuple(_card(data, policy) for policy in data.policies) if few else (),
        parts=() if few else (_policies(data),),
    )


def special_sentence(data: ReportData) -> str | None:
    """The answer to the question that the run was made for, where it is one of the benchmark's."""
    found = (data_efficiency.sentence(data), lifelong.sentence(data), robustness.sentence(data))
    return next((sentence for sentence in found if sentence), None)


def headline(data: ReportData) -> str:
    """The result in a sentence, about the last policy and what it is compared with."""
    special = special_sentence(data)
    if special is not None:
        return special + " Some of the runs are partial." * any(map(left_out.is_partial, data.policies))
    last, before = data.policies[-1], data.policies[:-1]
    text = (
        f"{last.label} solves {fmt.percent(last.average.value)} of trials (95 % interval {fmt.interval(last.average)})"
    )
    if len(last.tasks) > 1:
        text += f", averaged over {fmt.count(len(last.tasks), 'task')}"
    if left_out.is_partial(last):
        text += " of a partial run"
    alike = [one for one in before if comparable.same_tasks(one, last) and not comparable.differences(one, last)]
    if 0 < len(alike) <= 3:
        text += "; " + fmt.listed([f"{policy.label} {fmt.percent(policy.average.value)}" for policy in alike])
    text += "."  # it begins with a label, which stays as it is
    others = len(before) - len(alike)
    was = "policy was" if others == 1 else "policies were"
    return text + (f" {others} more {was} tried on other tasks or by other rules." if others else "")


def what_was_run(data: ReportData) -> str:
    """Policies, tasks, trials, scenes and rules."""
    policies = data.single
    trials = sum(r.rate.trials for policy in policies for tasks in policy.conditions.values() for r in tasks)
    per_task = sorted({r.rate.trials for policy in policies for r in policy.tasks})
    each = fmt.count(per_task[0], "trial") if len(per_task) == 1 else f"{per_task[0]} to {per_task[-1]} trials"
    splits = fmt.listed(sorted({beside_published.SPLITS.get(p.header.split, p.header.split) for p in policies}))
    rules = fmt.listed(sorted({beside_published.horizon_phrase(p) for p in policies}))
    success = fmt.listed(sorted({beside_published.success_phrase(p) for p in policies}))
    text = (
        f"{fmt.count(len(policies), 'policy', 'policies')}, {fmt.count(len(data.task_names), 'task')}, {each} "
        f"of each: {fmt.count(trials, 'trial')} in {splits}. A trial lasts up to {rules} and is solved {success}."
    )
    text = " ".join([text, *beside_published.simulators(data.policies)])
    conditions = list(dict.fromkeys(name for policy in policies for name in policy.conditions))
    if conditions != [UNPERTURBED]:
        text += f" Perturbations: {fmt.listed([robustness.spelled(name) for name in conditions])}."
    return text


def how_sure(data: ReportData) -> str:
    """How far the intervals reach: near 0 and 100 % to one side only."""
    last = data.policies[-1]
    reach = [max(r.rate.high - r.rate.rate, r.rate.rate - r.rate.low) for r in last.tasks]
    text = f"One task's rate may be up to {100 * max(reach):.0f} points off (95 % intervals)"
    if len(reach) > 1:
        average = last.average
        far = max(average.high - average.value, average.value - average.low)
        text += f", the average over {len(reach)} tasks up to {100 * far:.1f}"
    scenes = "kitchens" if last.simulator is None else "scenes"
    return text + f". Intervals speak about these tasks in {scenes} drawn like these, not about other tasks."


def beside(data: ReportData) -> str | None:
    """The published numbers that stand in the tables, and that the kitchens differ."""
    if not any(policy.group("average", UNPERTURBED) or policy.places for policy in data.policies):
        return None
    return f"Published results stand beside ours in the tables. {beside_published.published_kitchens(data.policies)}"


def errors(data: ReportData) -> str | None:
    """How many trials ended in an error."""
    tasks = [r for policy in data.policies for tasks in policy.conditions.values() for r in tasks]
    broken, trials = sum(r.errors for r in tasks), sum(r.rate.trials for r in tasks)
    if not broken:
        return None
    was = "trial ended in an error and counts" if broken == 1 else "trials ended in an error and count"
    return f"{broken:,} of {trials:,} {was} as not solved; the errors are listed at the end."


def _card(data: ReportData, policy: PolicyResult) -> Card:
    solved = sum(r.rate.successes for r in policy.tasks)
    return Card(
        label=policy.label,
        text=fmt.percent(policy.average.value),
        bar=Bar(policy.average, data.series(policy)),
        line=f"95 % interval {fmt.interval(policy.average)} · {solved:,} of {policy.trials:,} trials · "
        f"{fmt.count(len(policy.tasks), 'task')}{' · partial' * left_out.is_partial(policy)}",
        what=describe_policy(policy),
    )


def _policies(data: ReportData) -> Table:
    rows = tuple(
        (
            Cell(policy.label, series=data.series(policy)),
            Cell(
                fmt.percent(policy.average.value),
                policy.average.value,
                fmt.interval(policy.average),
                Bar(policy.average, data.series(policy)),
                strong=True,
            ),
            Cell(f"{len(policy.tasks)}", len(policy.tasks), tag="partial" if left_out.is_partial(policy) else ""),
            Cell(f"{policy.trials:,}", policy.trials),
            Cell(describe_policy(policy)),
        )
        for policy in data.policies
    )
    columns = (
        Column("policy"),
        Column("success, mean over tasks", numeric=True, wide=True),
        Column("tasks", numeric=True),
        Column("trials", numeric=True),
        Column("what it is"),
    )
    return Table("policies", "The policies", columns, rows, cards=True)
