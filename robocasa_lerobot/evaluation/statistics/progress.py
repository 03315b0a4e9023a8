"""How far trials come on average, where success alone would say nothing but 0."""

from __future__ import annotations

from collections.abc import Sequence

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.statistics.averages import Estimate
from robocasa_lerobot.wilson import CONFIDENCE, wilson_interval


def mean_progress(shares: Sequence[float], confidence: float = CONFIDENCE) -> Estimate:
    """The mean of shares in [0, 1], with Wilson's interval for so many trials of that mean.

    The interval is on the safe side: of all numbers in [0, 1] with a given mean, zeros and ones vary most.

    Raises:
        UserError: no shares, or one outside of [0, 1].
    """
    if not shares or not all(0 <= share <= 1 for share in shares):
        raise UserError(f"progress of {len(shares)} trials: expected at least one, each from 0 to 1.")
    mean = sum(shares) / len(shares)
    low, high = wilson_interval(mean * len(shares), len(shares), confidence)
    return Estimate(mean, low, high)
