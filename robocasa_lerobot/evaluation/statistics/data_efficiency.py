"""How many target demonstrations pretraining is worth: success against demonstrations, with and without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.statistics.averages import Counts
from robocasa_lerobot.wilson import CONFIDENCE

Array = NDArray[np.float64]
RESAMPLES = 2000


@dataclass(frozen=True)
class DataWorth:
    """A pretrained policy with `demos` target demonstrations per task equals target-only training with `equal_demos`.

    `factor` is their ratio (None at 0 demos). `bound` says that the curve without pretraining never crosses that
    success: "at least" above its last point, "at most" below its first; `equal_demos` is then that end of the curve.
    `low` and `high` are the interval of `equal_demos`, None where there are no trial counts; they too stop at the
    curve's ends, and `low_bound` and `high_bound` say so.
    """

    demos: int
    success: float
    equal_demos: float
    factor: float | None
    bound: str | None = None
    low: float | None = None
    high: float | None = None
    low_bound: str | None = None
    high_bound: str | None = None


def demos_for_success(demos: Array, success: Array, wanted: Array) -> Array:
    """Demonstrations at which a curve reaches `wanted` success; 0 below its first point and for none, infinity above
    its last.

    Linear between points in the logarithm of demonstrations. Noise may make a curve fall; it is made monotone first
    (isotonic regression), since more demonstrations are not worse for the question asked here.

    Args:
        demos: (n,) demonstrations per task, ascending and above 0.
        success: (..., n) success rates there.
        wanted: (...) success rate to reach.
    """
    from scipy.optimize import isotonic_regression

    flat, goals = success.reshape(-1, success.shape[-1]), np.broadcast_to(wanted, success.shape[:-1]).reshape(-1)
    logs, out = np.log(demos), np.empty(len(flat))
    for i, (row, goal) in enumerate(zip(flat, goals, strict=True)):
        rising = row if np.all(np.diff(row) >= 0) else isotonic_regression(row).x
        if goal > rising[-1]:
            out[i] = np.inf
        elif goal < rising[0] or goal <= 0.0:  # no demonstration is needed for no success
            out[i] = 0.0
        else:
            # On a flat piece the fewest demonstrations count: np.interp needs rising values, so the first is found.
            j = int(np.searchsorted(rising, goal, side="left"))
            if j == 0:
                out[i] = demos[0]
            else:
                share = (goal - rising[j - 1]) / (rising[j] - rising[j - 1])
                out[i] = np.exp(logs[j - 1] + share * (logs[j] - logs[j - 1]))
    return out.reshape(success.shape[:-1])


def worth_of_pretraining(
    target_only: Mapping[int, float | Counts],
    pretrained: Mapping[int, float | Counts],
    rng: np.random.Generator | None = None,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
) -> list[DataWorth]:
    """For every pretrained point, the target demonstrations that reach the same success without pretraining.

    Args:
        target_only: demonstrations per task -> success rate, or (successes, trials) of each task.
        pretrained: the same after pretraining; 0 demonstrations is the pretrained policy itself.
        rng: generator for the interval: the counts are drawn again within tasks, percentiles of the answers are taken.
        confidence: level of the interval.
        resamples: draws.

    Raises:
        UserError: fewer than two points without pretraining (no curve), or none with it.
    """
    if len(target_only) < 2 or not pretrained:
        raise UserError(
            f"{len(target_only)} point(s) without and {len(pretrained)} with pretraining: a curve needs at least two "
            "without and one with it."
        )
    demos = np.array(sorted(target_only), dtype=np.float64)
    curve = np.array([_rate(target_only[int(n)]) for n in demos])
    drawn = [target_only[int(n)] for n in demos]
    redraw = rng is not None and not any(isinstance(p, (int, float)) for p in (*drawn, *pretrained.values()))
    curves = np.stack([_draw(p, rng, resamples) for p in drawn], axis=-1) if redraw and rng else None
    out = []
    for n, point in sorted(pretrained.items()):
        success = _rate(point)
        equal, bound = _bounded(float(demos_for_success(demos, curve, np.array(success))), demos)
        ends: dict[str, float | str | None] = {}
        if curves is not None and rng is not None:
            answers = demos_for_success(demos, curves, _draw(point, rng, resamples))
            tail = (1 - confidence) / 2
            low, high = np.quantile(answers, [tail, 1 - tail], method="inverted_cdf")
            ends["low"], ends["low_bound"] = _bounded(float(low), demos)
            ends["high"], ends["high_bound"] = _bounded(float(high), demos)
        out.append(DataWorth(n, success, equal, equal / n if n else None, bound, **ends))  # type: ignore[arg-type]
    return out


def _bounded(demos: float, curve: Array) -> tuple[float, str | None]:
    if demos == 0:
        return float(curve[0]), "at most"
    return (float(curve[-1]), "at least") if np.isinf(demos) else (demos, None)


def _rate(point: float | Counts) -> float:
    if isinstance(point, (int, float)):
        return float(point)
    return float(np.mean([x / n for x, n in point if n]))


def _draw(point: float | Counts, rng: np.random.Generator, resamples: int) -> Array:
    """Mean success rates (resamples,) of counts drawn again, within tasks, about the rates that were found.

    They vary as trials of rates that are shrunk by half a trial, since a task at 0 would not vary at all; but about the
    found ones: shrinking pulls the less, the more trials there are, and would move one curve against the other.
    """
    assert not isinstance(point, (int, float))
    x, n = (np.array(column, dtype=np.float64) for column in zip(*(pair for pair in point if pair[1]), strict=True))
    shrunk = (x + 0.5) / (n + 1)
    drawn = rng.binomial(n.astype(int), shrunk, size=(resamples, len(n))) / n
    means: Array = np.clip((x / n - shrunk + drawn).mean(axis=1), 0.0, 1.0)
    return means
