"""Averages over tasks: each task is a stratum with its own rate, and no task is a sample of the others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.wilson import CONFIDENCE

Counts = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval; rates lie in [0, 1], differences of rates in [-1, 1]."""

    value: float
    low: float
    high: float


def average_over_tasks(counts: Counts, confidence: float = CONFIDENCE) -> Estimate:
    """The mean success rate of tasks, every task weighing the same, with an interval for exactly these tasks.

    Trials vary within tasks only, so the variance of the mean is `sum(p_i (1 - p_i) / n_i) / k^2`. The interval is
    Wilson's for the number of trials that a single task would need for that variance (the effective sample size of
    surveys), with rates shrunk to (x + 1/2) / (n + 1) in the variance, so that 0 of n is not mistaken for certainty.
    With one task, or tasks of one and the same rate, it is Wilson's interval of all trials.
    Source: effective sample sizes with Wilson's interval as in N. Dean and M. Pagano, "Evaluating confidence interval
    methods for binomial proportions in clustered surveys", J. Survey Statistics and Methodology 3 (2015); chosen by
    simulated coverage, docs/decisions/0015-intervals-of-averages.md.

    Args:
        counts: (successes, trials) of each task; a task without trials is left out.
        confidence: level of the interval.

    Raises:
        UserError: no task has trials, or successes outside 0..trials.
    """
    from statsmodels.stats.proportion import proportion_confint

    counts = _with_trials(counts)
    shrunk = [(x + 0.5) / (n + 1) for x, n in counts]
    centre, tasks = sum(shrunk) / len(counts), len(counts)
    variance = sum(p * (1 - p) / n for p, (_, n) in zip(shrunk, counts, strict=True)) / tasks**2
    effective = centre * (1 - centre) / variance
    value = sum(x / n for x, n in counts) / tasks
    low, high = proportion_confint(value * effective, effective, alpha=1 - confidence, method="wilson")
    return Estimate(value, 0.0 if value == 0 else float(low), 1.0 if value == 1 else float(high))


def linear_combination(
    parts: Sequence[Estimate], weights: Sequence[float], correlation: Sequence[Sequence[float]] | None = None
) -> Estimate:
    """The sum of a few estimates times weights, its interval recovered from theirs.

    The lower end is `value - sqrt(sum((w_i v_i - low end of w_i v_i)^2))`, the upper end alike: each side adds the
    squared distances of its own side, so that skewed intervals (0 of n) stay skewed. A negative weight exchanges ends.
    Source: R. G. Newcombe, "Interval estimation for the difference between independent proportions", Statistics in
    Medicine 17 (1998); general form: G. Y. Zou and A. Donner, "Construction of confidence limits about effect
    measures", ibid. 27 (2008).

    Args:
        parts: estimates with intervals.
        weights: one for each.
        correlation: matrix between the parts; default: independent.

    Raises:
        UserError: no parts.
    """
    if not parts:
        raise UserError("an average of nothing: expected at least one task with trials.")
    below, above = [], []
    for part, weight in zip(parts, weights, strict=True):
        ends = (weight * (part.value - part.low), weight * (part.high - part.value))
        # Signed distances, so that a correlation keeps its sign through a negative weight.
        below.append(ends[0] if weight >= 0 else ends[1])
        above.append(ends[1] if weight >= 0 else ends[0])
    value = sum(weight * part.value for part, weight in zip(parts, weights, strict=True))
    down, up = (math.sqrt(max(0.0, _quadratic(side, correlation))) for side in (below, above))
    return Estimate(value, value - down, value + up)


def ratio(part: Estimate, whole: Estimate) -> Estimate | None:
    """One rate as a share of another, its interval recovered from theirs, which count as independent.

    None where the second is 0; with a lower end of 0 there, the upper end is infinite. Source: A. Donner and G. Y. Zou,
    "Closed-form confidence intervals for functions of the normal mean and standard deviation", Statistical Methods in
    Medical Research 21 (2012), for a ratio; its lower end written so that nothing cancels.
    """
    if whole.value <= 0:
        return None
    product = part.value * whole.value
    of_low, of_high = part.low * (2 * part.value - part.low), part.high * (2 * part.value - part.high)
    by_low, by_high = whole.low * (2 * whole.value - whole.low), whole.high * (2 * whole.value - whole.high)
    high = (product + math.sqrt(max(0.0, product**2 - of_high * by_low))) / by_low if by_low > 0 else math.inf
    below = product + math.sqrt(max(0.0, product**2 - of_low * by_high))
    return Estimate(part.value / whole.value, of_low / below if below > 0 else 0.0, high)


def _quadratic(side: Sequence[float], correlation: Sequence[Sequence[float]] | None) -> float:
    if correlation is None:
        return sum(x * x for x in side)
    return sum(correlation[i][j] * x * y for i, x in enumerate(side) for j, y in enumerate(side))


def _with_trials(counts: Counts) -> Counts:
    for successes, trials in counts:
        if not 0 <= successes <= trials:
            raise UserError(f"{successes} successes in {trials} trials: expected 0 <= successes <= trials.")
    kept = [(x, n) for x, n in counts if n]
    if not kept:
        raise UserError("an average of nothing: expected at least one task with trials.")
    return kept
