"""Two policies on the same trials: the same scene, start and instruction, so that only the policy differs."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.statistics.averages import Estimate, average_over_tasks, linear_combination

Outcomes = NDArray[np.bool_]


@dataclass(frozen=True)
class Paired:
    """Policy B against policy A on `pairs` trials.

    `only_a` and `only_b` are trials that just one of them solved: they alone carry evidence. `p_value` is the exact
    McNemar test's, two-sided; `p_holm` the same after Holm's correction for the number of tasks (of a single task).
    `difference` is the rate of B minus the rate of A, averaged over tasks.
    """

    pairs: int
    both: int
    only_a: int
    only_b: int
    neither: int
    difference: Estimate
    p_value: float
    p_holm: float | None = None


@dataclass(frozen=True)
class Comparison:
    """B against A over all tasks, and on each task: `single` without a correction for their number."""

    overall: Paired
    single: dict[str, Paired]

    @functools.cached_property
    def tasks(self) -> dict[str, Paired]:
        """On each task, with `p_holm`; when asked for, since statsmodels has all memory collected each time."""
        from statsmodels.stats.multitest import multipletests

        corrected = multipletests([one.p_value for one in self.single.values()], method="holm")[1]
        return {
            task: replace(one, p_holm=float(p)) for (task, one), p in zip(self.single.items(), corrected, strict=True)
        }


def exact_mcnemar(only_a: int, only_b: int) -> float:
    """Two-sided p-value of the exact McNemar test: a binomial test of the trials on which two policies differ.

    Within every task each of those trials has either outcome with probability 1/2 if the policies are equally good, so
    counts of several tasks may be added. Without such trials it is 1.
    Source: Q. McNemar, Psychometrika 12 (1947); computed by `statsmodels.stats.contingency_tables.mcnemar`.
    """
    from statsmodels.stats.contingency_tables import mcnemar

    if only_a + only_b == 0:
        return 1.0
    return min(1.0, float(mcnemar([[0, only_a], [only_b, 0]], exact=True).pvalue))


def compare(trials: Mapping[str, tuple[Outcomes, Outcomes]]) -> Comparison:
    """Compare two policies.

    Args:
        trials: task -> (successes of A, successes of B), the same trial at the same place.

    Raises:
        UserError: no pairs, or lengths that differ.
    """
    kept = {}
    for task, (a, b) in trials.items():
        a, b = np.asarray(a, dtype=bool), np.asarray(b, dtype=bool)
        if a.shape != b.shape or a.ndim != 1:
            raise UserError(f"{task}: {a.size} trials of one policy and {b.size} of the other; pairs need the same.")
        if a.size:
            kept[task] = (a, b)
    if not kept:
        raise UserError("nothing to compare: the two runs have no trial in common.")
    return Comparison(_paired(kept), {task: _paired({task: pair}) for task, pair in kept.items()})


def _paired(trials: Mapping[str, tuple[Outcomes, Outcomes]]) -> Paired:
    a = np.concatenate([pair[0] for pair in trials.values()])
    b = np.concatenate([pair[1] for pair in trials.values()])
    only_a, only_b = int((a & ~b).sum()), int((b & ~a).sum())
    return Paired(
        pairs=a.size,
        both=int((a & b).sum()),
        only_a=only_a,
        only_b=only_b,
        neither=int((~a & ~b).sum()),
        difference=paired_difference(trials),
        p_value=exact_mcnemar(only_a, only_b),
    )


def paired_difference(trials: Mapping[str, tuple[Outcomes, Outcomes]]) -> Estimate:
    """Rate of B minus rate of A, the mean over tasks, with an interval that knows that the trials are the same.

    Square-and-add of the two averages' intervals with their correlation, which is computed within tasks.
    Source: method 10 of R. G. Newcombe, "Improved confidence intervals for the difference between binomial proportions
    based on paired data", Statistics in Medicine 17 (1998); its continuity correction is replaced by a quarter trial
    added to each cell of a task's table.
    """
    pairs = [(np.asarray(a, dtype=bool), np.asarray(b, dtype=bool)) for a, b in trials.values() if len(a)]
    averages = [average_over_tasks([(int(pair[side].sum()), len(pair[side])) for pair in pairs]) for side in (0, 1)]
    moments = np.sum([_moments(a, b) for a, b in pairs], axis=0)
    r = float(moments[2] / math.sqrt(moments[0] * moments[1]))
    difference = linear_combination([averages[1], averages[0]], [1.0, -1.0], [[1.0, r], [r, 1.0]])
    return Estimate(difference.value, max(-1.0, difference.low), min(1.0, difference.high))


def _moments(a: Outcomes, b: Outcomes) -> NDArray[np.float64]:
    """Variance of A's rate, of B's rate, and their covariance, from the 2x2 table with a quarter trial in each cell.

    Without that quarter, two policies that never differed in a handful of trials would be called equal for certain.
    """
    n = len(a)
    both, only_a, only_b = ((float(np.count_nonzero(cell)) + 0.25) / (n + 1) for cell in (a & b, a & ~b, b & ~a))
    rate_a, rate_b = both + only_a, both + only_b
    return np.array([rate_a * (1 - rate_a), rate_b * (1 - rate_b), both - rate_a * rate_b]) / n
