"""Two policies on the same trials: who is better, how sure that is, and what so many trials could have shown."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from robocasa_lerobot.evaluation.report import comparable
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, is_reference, same_trials
from robocasa_lerobot.evaluation.statistics.paired import Comparison, Paired, compare
from robocasa_lerobot.evaluation.statistics.power import POWER, smallest_difference

MAX_PAIRS = 15
ALPHA = 0.05


@dataclass(frozen=True)
class Pair:
    """B against A on their common trials."""

    a: PolicyResult
    b: PolicyResult
    comparison: Comparison
    smallest: float | None


def section(data: ReportData) -> Section | None:
    """All pairs of policies, and the tasks of the main pair."""
    pairs = all_pairs(data)
    if not pairs:
        return None
    wanted = _main_policies(data)
    main = next((pair for pair in pairs if (pair.a, pair.b) == wanted), pairs[0])
    text = (
        "Only policies on the same trials are compared: the same kitchen, start, instruction, horizon and perturbation "
        "for both. "
        "Trials that both solve or both fail say nothing about which is better; the rest decide (exact McNemar test). "
        f"The last column is the true difference that so many trials would find with {100 * POWER:.0f} % probability.",
    )
    tables = [_pairs_table(pairs)]
    if len(main.comparison.tasks) > 1:
        tables.append(_tasks_table(main))
    return Section("comparison", "Which policy is better", text, parts=tuple(tables))


def all_pairs(data: ReportData) -> list[Pair]:
    """Every two policies with common trials; with many policies each one against the last only."""
    chosen = list(itertools.combinations(data.policies, 2))
    if len(chosen) > MAX_PAIRS:
        chosen = [(policy, data.policies[-1]) for policy in data.policies[:-1]]
    return [pair for a, b in chosen if (pair := make_pair(a, b)) is not None]


def make_pair(a: PolicyResult, b: PolicyResult) -> Pair | None:
    """B against A; None where they have no trial in common."""
    trials = same_trials(a, b)
    if not trials:
        return None
    comparison = compare(trials)
    overall = comparison.overall
    discordance = (overall.only_a + overall.only_b) / overall.pairs
    return Pair(a, b, comparison, smallest_difference(overall.pairs, discordance))


def main_pair(data: ReportData) -> Pair | None:
    """The last policy against the one before it that is no reference, if there are two with common trials."""
    wanted = _main_policies(data)
    return make_pair(*wanted) if wanted else None


def _main_policies(data: ReportData) -> tuple[PolicyResult, PolicyResult] | None:
    learned = [policy for policy in data.policies if not is_reference(policy)]
    policies = learned if len(learned) > 1 else list(data.policies)
    return (policies[-2], policies[-1]) if len(policies) > 1 else None


def sentence(data: ReportData) -> str | None:
    """The main comparison in plain words, or why there is none; None where there is one policy."""
    wanted = _main_policies(data)
    if wanted is None:
        return None
    pair = make_pair(*wanted)
    if pair is None:
        return _nothing_in_common(*wanted)
    overall, tasks = pair.comparison.overall, pair.comparison.tasks
    difference = overall.difference
    on = f"on the same {fmt.count(overall.pairs, 'trial')}"
    if overall.p_value < ALPHA and difference.value * (overall.only_b - overall.only_a) <= 0:
        # The test counts trials, and the difference weighs tasks alike: where tasks have unequal numbers of trials the
        # two may point different ways.
        text = (
            f"{pair.b.label} and {pair.a.label} cannot be ranked, since the tasks disagree: counted by trials, "
            f"{pair.b.label} alone solved {overall.only_b:,} and {pair.a.label} alone {overall.only_a:,} (p "
            f"{_p(overall.p_value)}, exact McNemar test {on}), while the mean over tasks differs by "
            f"{fmt.points(difference.value)} points (95 % interval {fmt.points_interval(difference)})."
        )
    elif overall.p_value < ALPHA:
        verdict = "better" if difference.value > 0 else "worse"
        text = (
            f"{pair.b.label} is {verdict} than {pair.a.label} by {abs(100 * difference.value):.1f} points "
            f"(95 % interval {fmt.points_interval(difference)}; p {_p(overall.p_value)}, exact McNemar test {on})."
        )
    else:
        text = (
            f"{pair.b.label} and {pair.a.label} cannot be told apart: {fmt.points(difference.value)} points (95 % "
            f"interval {fmt.points_interval(difference)}; p {_p(overall.p_value)}, exact McNemar test {on})."
        )
    if len(tasks) > 1:
        clear = [task for task in tasks.values() if (task.p_holm or 0) < ALPHA]
        better = sum(task.only_b > task.only_a for task in clear)
        text += (
            f" On {better} of {len(tasks)} single tasks it is clearly better, on {len(clear) - better} clearly worse."
            if clear
            else f" No single task of the {len(tasks)} shows a clear difference."
        )
    if overall.p_value < ALPHA:
        return text
    if pair.smallest is not None:
        text += (
            f" So many trials would have shown a true difference of {100 * pair.smallest:.1f} points or more with "
            f"{100 * POWER:.0f} % probability."
        )
    else:
        text += " So few trials cannot show any difference."
    return text


def _nothing_in_common(a: PolicyResult, b: PolicyResult) -> str:
    what = [] if comparable.common_tasks(a, b) else ["tasks"]
    what += comparable.differences(a, b)
    what += ["perturbations"] if a.condition != b.condition else []
    what += ["rendering"] if a.header.render_preset != b.header.render_preset else []
    what += ["seeds"] if a.header.seed != b.header.seed else []
    # The same seed draws another scene in another version.
    why = f"they differ in {fmt.listed(what)}" if what else "their scenes are not the same ones"
    return f"{b.label} and {a.label} have no trial in common, so that nothing says which is better: {why}."


def _p(value: float) -> str:
    text = fmt.p_value(value)
    return text if text.startswith("<") else f"= {text}"


def _pairs_table(pairs: list[Pair]) -> Table:
    columns = (
        Column("B against A"),
        Column("common trials", numeric=True),
        Column("only A solved", numeric=True),
        Column("only B solved", numeric=True),
        Column("B minus A, points", numeric=True),
        Column("p, exact McNemar", numeric=True),
        Column("could be shown, points", numeric=True),
    )
    rows = tuple(
        (
            Cell(f"{pair.b.label} against {pair.a.label}"),
            _number(pair.comparison.overall.pairs),
            _number(pair.comparison.overall.only_a),
            _number(pair.comparison.overall.only_b),
            _difference(pair.comparison.overall),
            _p_cell(pair.comparison.overall.p_value),
            Cell(fmt.NONE) if pair.smallest is None else Cell(f"{100 * pair.smallest:.1f}", 100 * pair.smallest),
        )
        for pair in pairs
    )
    return Table("pairs", "Policies compared on the trials they have in common", columns, rows, cards=True)


def _tasks_table(pair: Pair) -> Table:
    columns = (
        Column("task"),
        Column(pair.a.label, numeric=True),
        Column(pair.b.label, numeric=True),
        Column("only A", numeric=True),
        Column("only B", numeric=True),
        Column("B minus A, points", numeric=True),
        Column("p", numeric=True),
        Column("p after Holm", numeric=True),
    )
    rows = []
    ranked = sorted(pair.comparison.tasks.items(), key=lambda item: (item[1].p_value, -abs(item[1].difference.value)))
    for task, one in ranked:
        rates = ((one.both + only) / one.pairs for only in (one.only_a, one.only_b))
        rows.append(
            (
                Cell(task, code=True),
                *(Cell(fmt.percent(rate), rate) for rate in rates),
                _number(one.only_a),
                _number(one.only_b),
                _difference(one),
                _p_cell(one.p_value),
                _p_cell(one.p_holm if one.p_holm is not None else 1.0),
            )
        )
    return Table(
        "pair-tasks",
        f"Task by task: A is {pair.a.label}, B is {pair.b.label}",
        columns,
        tuple(rows),
        notes=(
            f"Holm's correction for {len(rows)} tasks keeps the chance of even one false finding at 5 %.",
            f"Between {rows[0][0].text if len(rows) == 1 else 'tasks'} the number of trials may differ."
            if len({one.pairs for one in pair.comparison.tasks.values()}) > 1
            else f"{next(iter(pair.comparison.tasks.values())).pairs} common trials of each task.",
        ),
        folded=len(rows) > 12,
    )


def _difference(one: Paired) -> Cell:
    return Cell(
        fmt.points(one.difference.value), 100 * one.difference.value, fmt.points_interval(one.difference), strong=True
    )


def _p_cell(p: float) -> Cell:
    return Cell(fmt.p_value(p), p, strong=p < ALPHA)


def _number(value: int) -> Cell:
    return Cell(f"{value:,}", value)
