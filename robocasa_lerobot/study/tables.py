"""The numbers of a study: rates of rows and columns over all seeds, with intervals, and what rows differ by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.evaluation.statistics.averages import Estimate, average_over_tasks
from robocasa_lerobot.evaluation.statistics.lifelong import Lifelong, lifelong
from robocasa_lerobot.evaluation.statistics.paired import paired_difference
from robocasa_lerobot.study.settings import PartConfig, variant_of
from robocasa_lerobot.study.stored import StoredRun, StoredTrial

Stored = Mapping[tuple[str, int], StoredRun]  # by experiment and seed


@dataclass(frozen=True)
class CellRate:
    """Mean rate of some tasks over all seeds.

    Attributes:
        rate: with its 95 % interval, which covers the drawing of trials, not that of trainings.
        trials: in all.
        seeds: the mean rate of each training.
    """

    rate: Estimate
    trials: int
    seeds: tuple[float, ...]


def row_trials(part: PartConfig, row: str, stored: Stored) -> list[tuple[int, StoredTrial]]:
    """Trials of a row, each with its run's seed."""
    wanted = part.rows[row]
    return [
        (seed, trial)
        for (experiment, seed), run in sorted(stored.items())
        if experiment == wanted.experiment and seed < part.seeds_of(experiment)
        for trial in run.trials
        if (trial.phase, trial.evaluation) == (wanted.phase, wanted.evaluation)
    ]


def cell(trials: Sequence[tuple[int, StoredTrial]], tasks: Iterable[str]) -> CellRate | None:
    """The rate of these tasks; None where one of them was not tried."""
    counts = [_count([trial for _, trial in trials if trial.task == task]) for task in tasks]
    if not counts or any(n == 0 for _, n in counts):
        return None
    seeds = sorted({seed for seed, _ in trials})
    each = []
    for seed in seeds:
        own = [_count([trial for s, trial in trials if s == seed and trial.task == task]) for task in tasks]
        each.append(float(np.mean([solved / n for solved, n in own if n])) if any(n for _, n in own) else float("nan"))
    return CellRate(average_over_tasks(counts), sum(n for _, n in counts), tuple(each))


def mean_of_each(cells: Iterable[CellRate | None]) -> tuple[float, ...]:
    """The mean over a row's cells, those that are there, of each training."""
    there = [found.seeds for found in cells if found is not None]
    return tuple(float(np.mean(own)) for own in zip(*there, strict=True))


def between_trainings(rows: Iterable[Sequence[float]]) -> tuple[float, int] | None:
    """By how much trainings differ that differ in their seed alone, each with its own trials; and of how many rows.

    `rows` have a rate of each training. A standard deviation, pooled over the rows with more than one training. None
    where there is no such row.
    """
    several = [seeds for seeds in rows if len(seeds) > 1]
    if not several:
        return None
    squares = sum(float(np.var(seeds, ddof=1)) * (len(seeds) - 1) for seeds in several)
    return float(np.sqrt(squares / sum(len(seeds) - 1 for seeds in several))), len(several)


def difference(
    one: Sequence[tuple[int, StoredTrial]], other: Sequence[tuple[int, StoredTrial]], tasks: Iterable[str]
) -> Estimate | None:
    """Rate of `one` minus rate of `other` over the trials that both have: of as many trainings as `one` has.

    None where they share none, or where `one` has trainings that `other` has not: its rate is not of these trials.
    """
    if not {seed for seed, _ in one} <= {seed for seed, _ in other}:
        return None
    kept = tuple(tasks)
    pairs: dict[str, tuple[list[bool], list[bool]]] = {}
    theirs = {(seed, trial.task, trial.trial, trial.seed): trial.success for seed, trial in other}
    for seed, trial in one:
        key = (seed, trial.task, trial.trial, trial.seed)
        if trial.task in kept and key in theirs:
            own = pairs.setdefault(trial.task, ([], []))
            own[0].append(theirs[key])
            own[1].append(trial.success)
    if not pairs:
        return None
    return paired_difference({task: (np.array(a), np.array(b)) for task, (a, b) in pairs.items()})


def variants(part: PartConfig) -> dict[str, dict[int, str]]:
    """Of a part with `matrix`: the rows of each variant, by phase."""
    found: dict[str, dict[int, str]] = {}
    for row in part.rows:
        variant = variant_of(row)
        assert variant is not None, "PartConfig has looked at its rows"
        found.setdefault(variant[0], {})[variant[1]] = row
    return found


def summaries(part: PartConfig, stored: Stored, sets: Mapping[str, Sequence[str]]) -> dict[str, Lifelong]:
    """Of a part with `matrix`: what each variant of which there are trials gained and forgot.

    Over their `whole_trainings`: what one training reached is not compared with what another kept.
    """
    found = {}
    for name, rows in variants(part).items():
        counts: dict[int, dict[int, list[tuple[int, int]]]] = {}
        of_rows = {phase: row_trials(part, row, stored) for phase, row in rows.items()}
        whole = whole_trainings(of_rows.values())
        for phase in rows:
            trials = [trial for seed, trial in of_rows[phase] if seed in whole]
            for number, task_set in enumerate(part.sets, start=1):
                own = [_count([trial for trial in trials if trial.task == task]) for task in sets[task_set]]
                if all(n for _, n in own):
                    counts.setdefault(phase, {})[number] = own
        if counts:
            found[name] = lifelong(counts)
    return found


def whole_trainings(rows: Iterable[Sequence[tuple[int, StoredTrial]]]) -> set[int]:
    """Of a variant's rows: the seeds of the trainings that have come as far as any."""
    there = [{seed for seed, _ in trials} for trials in rows if trials]
    return set.intersection(*there) if there else set()


def failure_terms(trials: Iterable[tuple[int, StoredTrial]], most: int = 5) -> list[tuple[str, str, int]]:
    """The terms of goals that kept most trials from success: task, term, trials."""
    counts = Counter((trial.task, term) for _, trial in trials for term in trial.failed)
    return [(task, term, n) for (task, term), n in counts.most_common(most)]


def _count(trials: Sequence[StoredTrial]) -> tuple[int, int]:
    return sum(trial.success for trial in trials), len(trials)
