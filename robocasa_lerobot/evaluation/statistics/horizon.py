"""Success against time: what a shorter or longer horizon would have changed, and how long a success takes."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.wilson import CONFIDENCE, wilson_interval

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SuccessCurve:
    """Share of trials solved by each time; `times` in the caller's unit, `rate`, `low`, `high` in [0, 1]."""

    times: Array
    rate: Array
    low: Array
    high: Array

    def at(self, time: float) -> float:
        """Share of trials solved at `time` or before."""
        index = int(np.searchsorted(self.times, time, side="right")) - 1
        return float(self.rate[index]) if index >= 0 else 0.0


@dataclass(frozen=True)
class TimeToSuccess:
    """Quartiles over the solved trials, in the caller's unit."""

    solved: int
    first_quartile: float
    median: float
    third_quartile: float


def success_curve(
    first_success: Sequence[float | None], ended: Sequence[float], confidence: float = CONFIDENCE
) -> SuccessCurve:
    """One minus the Kaplan-Meier estimate of not having succeeded yet, with log-log intervals.

    A trial without success is censored at its horizon, so tasks with different horizons may be put together when times
    are shares of the horizon. Where all trials have the same horizon it is the plain share of trials solved so far.
    Source: E. L. Kaplan and P. Meier, JASA 53 (1958); computed by `scipy.stats.ecdf`.

    Args:
        first_success: time of the first success of each trial, None where there was none.
        ended: horizon of each trial, where a trial without success is censored.
        confidence: level of the pointwise intervals.

    Raises:
        UserError: no trials.
    """
    from scipy.stats import CensoredData, ecdf

    if not len(ended):
        raise UserError("no trials: a success curve needs at least one.")
    solved = [float(t) for t in first_success if t is not None]
    open_end = [float(e) for t, e in zip(first_success, ended, strict=True) if t is None]
    nothing, everything = (wilson_interval(x, len(ended), confidence) for x in (0, len(ended)))
    if not solved:
        times = np.unique(np.asarray(open_end))
        return SuccessCurve(times, *(np.full(len(times), value) for value in (0.0, *nothing)))
    distribution = ecdf(CensoredData(uncensored=solved, right=open_end)).cdf
    with warnings.catch_warnings(), np.errstate(divide="ignore", invalid="ignore"):
        # log(-log(S)) has no value at S = 0 or 1; the interval there is Wilson's.
        warnings.simplefilter("ignore", RuntimeWarning)
        ends = distribution.confidence_interval(confidence_level=confidence, method="log-log")
    rate = np.asarray(distribution.probabilities, dtype=np.float64)
    low, high = (np.asarray(end.probabilities, dtype=np.float64) for end in (ends.low, ends.high))
    return SuccessCurve(
        np.asarray(distribution.quantiles, dtype=np.float64),
        rate,
        np.where(np.isnan(low), np.where(rate > 0.5, everything[0], nothing[0]), low),
        np.where(np.isnan(high), np.where(rate > 0.5, everything[1], nothing[1]), high),
    )


def time_to_success(first_success: Sequence[float | None]) -> TimeToSuccess | None:
    """Quartiles of the time to success over the solved trials; None where no trial was solved."""
    solved = [float(t) for t in first_success if t is not None]
    if not solved:
        return None
    quartiles = np.quantile(solved, [0.25, 0.5, 0.75])
    return TimeToSuccess(len(solved), *(float(q) for q in quartiles))
