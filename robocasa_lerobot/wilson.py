"""The interval of a success rate."""

from __future__ import annotations

from robocasa_lerobot.errors import UserError

# Level of every interval of this package.
CONFIDENCE = 0.95


def wilson_interval(successes: float, trials: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Wilson score interval (low, high) of a binomial proportion, as statsmodels computes it.

    It stays inside [0, 1] and has a sensible width at 0 of n and n of n. `successes` need not be whole.
    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927).

    Raises:
        UserError: no trials, or successes outside 0..trials.
    """
    from statsmodels.stats.proportion import proportion_confint

    if trials <= 0 or not 0 <= successes <= trials:
        raise UserError(
            f"{successes} successes in {trials} trials: expected at least 1 trial and 0 <= successes <= trials."
        )
    low, high = proportion_confint(successes, trials, alpha=1 - confidence, method="wilson")
    # The ends are exactly 0 and 1 there; rounding leaves 1e-17.
    return (0.0 if successes == 0 else float(low)), (1.0 if successes == trials else float(high))
