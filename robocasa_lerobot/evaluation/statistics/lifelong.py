"""Lifelong learning: what each phase gained, and what it cost the phases before it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.statistics.averages import Counts, Estimate, average_over_tasks, linear_combination


@dataclass(frozen=True)
class Lifelong:
    """The matrix R[k][j], success on the tasks of phase j after training phase k (both from 1), and its summaries.

    average: after phase k, the mean of R[k][j] over j <= k (average accuracy of D. Lopez-Paz and M. Ranzato, "Gradient
        episodic memory for continual learning", NeurIPS 2017). Like forgetting and backward transfer there only where
        all of its terms are there for the phases that any row has: the mean of some is another number. So is forward
        transfer.
    forgetting: after phase k, the mean over j < k of (the best of R[l][j] over j <= l < k) - R[k][j]; positive is loss
        (A. Chaudhry et al., "Riemannian walk for incremental learning", ECCV 2018). The interval takes the best earlier
        phase as given.
    backward_transfer: with T the last phase, the mean over j < T of R[T][j] - R[j][j]; negative is forgetting
        (Lopez-Paz and Ranzato).
    forward_transfer: the mean over j > 1 of R[j-1][j] - b[j], where b[j] is the success of the untrained policy on the
        tasks of phase j (Lopez-Paz and Ranzato); None where those trials were not run.
    """

    matrix: dict[int, dict[int, Estimate]]
    average: dict[int, Estimate]
    forgetting: dict[int, Estimate]
    backward_transfer: Estimate | None
    forward_transfer: Estimate | None


def lifelong(counts: Mapping[int, Mapping[int, Counts]], untrained: Mapping[int, Counts] | None = None) -> Lifelong:
    """Summaries of a lifelong evaluation.

    Args:
        counts: phase trained -> phase evaluated -> (successes, trials) of each of its tasks.
        untrained: phase evaluated -> the same for the untrained policy, for forward transfer.

    Intervals treat the phases' trials as independent, which is cautious when they are the same trials.

    Raises:
        UserError: nothing evaluated.
    """
    matrix = {
        k: {j: average_over_tasks(tasks) for j, tasks in sorted(row.items()) if any(n for _, n in tasks)}
        for k, row in sorted(counts.items())
    }
    matrix = {k: row for k, row in matrix.items() if row}
    if not matrix:
        raise UserError("a lifelong evaluation without trials: expected the results of at least one phase.")
    average, forgetting = {}, {}
    columns = {j for row in matrix.values() for j in row}
    for k, row in matrix.items():
        seen = [row[j] for j in row if j <= k]
        if seen and all(j in row for j in columns if j <= k):
            average[k] = _mean(seen)
        lost = _losses(matrix, k)
        if lost and len(lost) == sum(j < k for j in columns):
            forgetting[k] = _mean_of_differences(lost)
    last = max(matrix)
    backward = [(matrix[last][j], matrix[j][j]) for j in matrix[last] if j < last and j in matrix.get(j, {})]
    if len(backward) < sum(j < last for j in columns):
        backward = []
    start = {j: average_over_tasks(tasks) for j, tasks in (untrained or {}).items() if any(n for _, n in tasks)}
    forward = [(matrix[j - 1][j], start[j]) for j in start if j > 1 and j in matrix.get(j - 1, {})]
    if len(forward) < sum(j > 1 for j in columns):
        forward = []
    return Lifelong(
        matrix=matrix,
        average=average,
        forgetting=forgetting,
        backward_transfer=_mean_of_differences(backward) if backward else None,
        forward_transfer=_mean_of_differences(forward) if forward else None,
    )


def _losses(matrix: Mapping[int, Mapping[int, Estimate]], k: int) -> list[tuple[Estimate, Estimate]]:
    """For each earlier phase j whose results since its own training are there: the best, and that after phase k."""
    out = []
    for j in matrix[k]:
        before = [matrix[m][j] for m in range(j, k) if j in matrix.get(m, {})]
        if j < k and len(before) == k - j:
            out.append((max(before, key=lambda estimate: estimate.value), matrix[k][j]))
    return out


def _mean(parts: list[Estimate]) -> Estimate:
    mean = linear_combination(parts, [1 / len(parts)] * len(parts))
    return Estimate(mean.value, max(0.0, mean.low), min(1.0, mean.high))


def _mean_of_differences(pairs: list[tuple[Estimate, Estimate]]) -> Estimate:
    parts = [part for pair in pairs for part in pair]
    mean = linear_combination(parts, [1 / len(pairs), -1 / len(pairs)] * len(pairs))
    return Estimate(mean.value, max(-1.0, mean.low), min(1.0, mean.high))
