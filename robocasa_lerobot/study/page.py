"""The study's results as a page of Markdown with figures: each question, its answer in a sentence, tables, compute."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from robocasa_lerobot.evaluation.report.numbers import listed
from robocasa_lerobot.evaluation.statistics.averages import Estimate, linear_combination, ratio
from robocasa_lerobot.evaluation.statistics.lifelong import Lifelong
from robocasa_lerobot.files import write_text
from robocasa_lerobot.study.figures import draw_curves, draw_matrices, draw_rates
from robocasa_lerobot.study.runs import CPU
from robocasa_lerobot.study.settings import PartConfig, RowConfig, StudyConfig
from robocasa_lerobot.study.stored import (
    FILMED_SEED,
    StoredRun,
    StoredTrial,
    circumstances,
    stored_folder,
    strips_name,
)
from robocasa_lerobot.study.tables import (
    CellRate,
    Stored,
    between_trainings,
    cell,
    difference,
    failure_terms,
    mean_of_each,
    row_trials,
    summaries,
    variants,
    whole_trainings,
)

Sets = Mapping[str, Sequence[str]]
_HEAD = """# Results

What small policies learn in our kitchens, and what helps them. Written by `robocasa-lerobot study` from the trials,
curves and circumstances that are kept in {folder}. The same command makes them again, part by part, from
nothing but seeds (`configs/study*.yaml`). Intervals are 95 % and cover the drawing of trials: what another training
would change, the seeds beside each other show. Trials of one seed are the same in all rows with the same evaluation,
and differences are computed from these pairs. Published numbers are of policies a thousand times as large, of human
demonstrations and other kitchens: they show the direction of an effect, no more.
"""


def write_page(study: StudyConfig, stored: Stored, sets: Sets, results: Path, page: Path) -> None:
    """Write the page, and its figures into the folder of the results.

    Args:
        study: whose questions they are.
        stored: the runs that have ended.
        sets: tasks of each set.
        results: folder of what was kept.
        page: Markdown file.
    """
    folder = _relative(results, page)
    kept = results.is_dir() and any(results.iterdir())
    link = f"[`{folder}`]({folder})" if kept else f"`{folder}`"
    short = ["## In short", ""]
    lines: list[str] = []
    for name, part in study.parts.items():
        own = {key: run for key, run in stored.items() if key[0] in part.experiments and key[1] < part.seeds_of(key[0])}
        lines += [f"## {part.asks}", ""]
        lines += [f"Published: {part.published}", ""] if part.published else []
        if not own:
            lines += [
                f"Not run yet: `robocasa-lerobot study {name}`, with the `--results` and `--page` of this page.",
                "",
            ]
            continue
        answers, text = _part(name, part, own, sets, results, folder)
        lines += text
        question = f"- [{part.asks}](#{_anchor(part.asks)})"
        short += [question, *(f"  {answer}" for answer in answers)] if part.matrix else [f"{question} {answers[0]}"]
    short = [*short, ""] if len(short) > 2 else []
    page.parent.mkdir(parents=True, exist_ok=True)
    write_text(page, "\n".join([_HEAD.format(folder=link), *short, *lines]).rstrip("\n") + "\n")


def _part(
    name: str, part: PartConfig, stored: Stored, sets: Sets, results: Path, folder: str
) -> tuple[list[str], list[str]]:
    """Its answers, a line for each variant of a matrix or one, and all of its section below the question."""
    there = {row: trials for row in part.rows if (trials := row_trials(part, row, stored))}
    head = ["", *part.sets, "trials", f"each training, {part.sets[0]}"]
    head += [f"against {part.reference}"] if part.reference else []
    table: list[list[str]] = []
    rates: dict[str, CellRate] = {}
    against: dict[str, Estimate] = {}
    each: dict[RowConfig, Sequence[float]] = {}  # rows may share a phase
    for row, trials in there.items():
        cells = [cell(trials, sets[task_set]) for task_set in part.sets]
        first = cells[0]
        if first is not None:
            rates[row] = first
            each[part.rows[row]] = mean_of_each(cells) if part.matrix else first.seeds
        line = [row, *map(_shown, cells), str(len(trials)), _seeds(first)]
        if part.reference:
            compared = part.reference in there and row != part.reference
            points = difference(trials, there[part.reference], sets[part.sets[0]]) if compared else None
            line.append(_points(points))
            if points is not None:
                against[row] = points
        table.append(line)
    lifelong = summaries(part, stored, sets) if part.matrix else {}
    if part.matrix:
        answers = [
            _retained(name, rows, lifelong, _trainings(part, rows, there)) for name, rows in variants(part).items()
        ]
    else:
        answers = [_most(part, rates, against)]
    lines = [
        *answers,
        "",
        *_markdown(head, table),
        "",
        *_between(list(each.values()), ", each the mean of its columns" * part.matrix),
    ]
    if part.matrix:
        lines += _forgetting(len(part.sets), lifelong)
    if part.tasks:
        lines += _by_task(there, sets[part.sets[0]])
    figures = (f"{name}_rates.svg", f"{name}_curves.svg")
    if lifelong:
        draw_matrices(lifelong, len(part.sets), results / figures[0])
    elif rates:
        draw_rates(rates, part.sets[0], results / figures[0])
    if lifelong or rates:
        lines += [f"![Rates]({folder}/{figures[0]})", ""]
    draw_curves(stored.values(), results / figures[1])
    lines += [f"![Losses]({folder}/{figures[1]})", ""]
    apart: dict[RowConfig, str] = {}  # rows may share a phase
    for row in there:
        apart.setdefault(part.rows[row], row)
    for config, row in apart.items():
        lines += _strips(config, row, results, folder)
    terms = failure_terms(trial for row in apart.values() for trial in there[row])
    if terms:
        listed = "; ".join(f"{task}: `{term}` ({count})" for task, term, count in terms)
        lines += [f"What most often did not hold at the end of a failed trial: {listed}.", ""]
    return answers, [*lines, *_circumstances(part, stored.values()), ""]


def _most(part: PartConfig, rates: Mapping[str, CellRate], against: Mapping[str, Estimate]) -> str:
    """A sentence or two, of numbers alone."""
    if not rates:
        return "No row of the table has all its trials yet."
    if len(rates) < 3 and not against:
        return " ".join(
            f"{row}: {_percent(found.rate)} of {part.sets[0]}{_from(part, [row], len(found.seeds))}."
            for row, found in rates.items()
        )
    best = max(rates, key=lambda row: rates[row].rate.value)
    most = f"Most: {best}, {_percent(rates[best].rate)}"
    alike = [row for row in rates if row != best and math.isclose(rates[row].rate.value, rates[best].rate.value)]
    if alike:
        most += f", as much as {listed(alike)}"
    if best in against:
        assert part.reference is not None
        return f"{most}; against {part.reference}: {_points(against[best])}{_once(rates, best, part.reference)}."
    if best != part.reference or not against:
        return f"{most}{_once(rates, best)}."
    second = max(against, key=lambda row: against[row].value)
    return f"{most}; beside it, {second}: {_points(against[second])}{_once(rates, best, second)}."


def _once(rates: Mapping[str, CellRate], *rows: str) -> str:
    """That rows rest on one training, where they do."""
    alone = [row for row in rows if row in rates and len(rates[row].seeds) == 1]
    return "" if not alone else ", one training of each" if len(alone) > 1 else f", one training of {alone[0]}"


def _from(part: PartConfig, rows: Iterable[str], trainings: int) -> str:
    """How many trainings a number rests on, where that is one or fewer than the part has."""
    wanted = min(part.seeds_of(part.rows[row].experiment) for row in rows)
    if trainings == 1:
        return ", from one training"
    return f", from {trainings} of {wanted} trainings" if trainings < wanted else ""


def _between(rows: Sequence[Sequence[float]], of_what: str) -> list[str]:
    found = between_trainings(rows)
    if found is None:
        return []
    deviation, number = found
    text = (
        f"Trainings that differ in their seed alone, each with its own trials, differ by {100 * deviation:.0f} points "
        f"(standard deviation, from {number} row{'s' if number > 1 else ''}{of_what}). Intervals do not cover that."
    )
    return [text, ""]


def _trainings(
    part: PartConfig, rows: Mapping[int, str], there: Mapping[str, Sequence[tuple[int, StoredTrial]]]
) -> str:
    """How many trainings the summary of a variant rests on, where that is to be said."""
    return _from(part, rows.values(), len(whole_trainings(there[row] for row in rows.values() if row in there)))


def _retained(name: str, rows: Mapping[int, str], lifelong: Mapping[str, Lifelong], trainings: str) -> str:
    found, last = lifelong.get(name), max(rows)
    matrix: Mapping[int, Mapping[int, Estimate]] = {} if found is None else found.matrix
    earlier = [j for j in rows if j < last and j in matrix.get(last, {}) and j in matrix.get(j, {})]
    if not earlier:
        return f"- {name}: not run to its end yet."
    after, before = _mean([matrix[last][j] for j in earlier]), _mean([matrix[j][j] for j in earlier])
    share = ratio(after, before)
    of_it = "" if share is None else f", {_percent(share)} of it"
    kept = f"{_percent(after)}{of_it}{trainings}"
    return f"- {name}: the earlier phases reached {_percent(before)}, and after the last one {kept}."


def _forgetting(last: int, lifelong: Mapping[str, Lifelong]) -> list[str]:
    rows = []
    for name, found in lifelong.items():
        unseen = [found.matrix[j - 1][j] for j in range(2, last + 1) if j in found.matrix.get(j - 1, {})]
        numbers = (found.average.get(last), found.forgetting.get(last), _mean(unseen) if unseen else None)
        rows.append([name, *map(_percent, numbers)])
    head = ["", f"all tasks after phase {last}", "forgetting", "next phase's tasks, before it"]
    return [*_markdown(head, rows), ""]


def _by_task(there: Mapping[str, Sequence[tuple[int, StoredTrial]]], tasks: Sequence[str]) -> list[str]:
    """Rates of each task and row, whichever of the two are fewer as columns."""
    of_rows = [[row, *(_shown(cell(trials, [task])) for task in tasks)] for row, trials in there.items()]
    if len(there) > len(tasks):
        return [*_markdown(["", *tasks], of_rows), ""]
    head, *of_tasks = zip(["task", *tasks], *of_rows, strict=True)
    return [*_markdown(head, of_tasks), ""]


def _strips(row: RowConfig, label: str, results: Path, folder: str) -> list[str]:
    """The picture of a row's films, where there is one."""
    place = stored_folder(Path(), row.experiment, FILMED_SEED) / strips_name(row.phase, row.evaluation)
    if not (results / place).is_file():
        return []
    return [f"![{label}: trials that were solved, and others]({folder}/{place.as_posix()})", ""]


def _circumstances(part: PartConfig, stored: Iterable[StoredRun]) -> list[str]:
    runs = list(stored)
    wanted = {(row.experiment, row.phase) for row in part.rows.values()}
    asked = sum(part.seeds_of(experiment) for experiment, _ in wanted)
    ended = sum((run.experiment, phase) in wanted for run in runs for phase in run.phases)
    each = [one for run in runs for one in circumstances(run.about)]
    training = sum(float(one["training_hours"]) for one in each)
    trying = sum(float(one["trial_hours_of_one_process"]) for one in each)
    commits = sorted({_short_commit(str(one["commit"])) for one in each})
    machines = sorted({f"{one['machine']['processor']}, {one['machine']['cores']} cores" for one in each})
    versions = sorted({f"{name} {number}" for one in each for name, number in one["versions"].items()})
    devices = ", ".join(sorted({str(one["device"]) for one in each} - {CPU}))
    text = (
        f"{ended} of {asked} trainings, {training:.1f} hours of training"
        f"{f' (on {devices})' if devices else ''} and {trying:.1f} process-hours of trials "
        f"on {'; '.join(machines)}; commits {', '.join(commits)}; {', '.join(versions)}."
    )
    scales = sorted({str(run.about["scale"]) for run in runs if run.about["scale"]})
    return [text, *([f"**Tried at the scale {', '.join(scales)}: these numbers mean nothing.**"] if scales else [])]


def _short_commit(commit: str) -> str:
    number, _, dirty = commit.partition("-")
    return number[:12] + (f"-{dirty}" if dirty else "")


def _markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    rule = "|".join(["---", *("--:" for _ in head[1:])])
    return [f"|{'|'.join(head)}|", f"|{rule}|", *(f"|{'|'.join(row)}|" for row in rows)]


def _shown(found: CellRate | None) -> str:
    return _percent(None if found is None else found.rate)


def _percent(rate: Estimate | None) -> str:
    return "" if rate is None else f"{100 * rate.value:.0f} % ({100 * rate.low:.0f} to {100 * rate.high:.0f})"


def _points(found: Estimate | None) -> str:
    return "" if found is None else f"{100 * found.value:+.0f} ({100 * found.low:+.0f} to {100 * found.high:+.0f})"


def _seeds(found: CellRate | None) -> str:
    return "" if found is None else ", ".join(f"{100 * rate:.0f}" for rate in found.seeds)


def _mean(parts: Sequence[Estimate]) -> Estimate:
    return linear_combination(parts, [1 / len(parts)] * len(parts))


def _anchor(heading: str) -> str:
    """Of a heading on GitHub's pages: small letters, digits and hyphens."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _relative(results: Path, page: Path) -> str:
    return results.resolve().relative_to(page.parent.resolve(), walk_up=True).as_posix()
