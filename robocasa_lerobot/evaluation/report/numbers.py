"""How numbers are written: the same everywhere in a report."""

from __future__ import annotations

from robocasa_lerobot.evaluation.statistics import Estimate, Rate

NBSP = "\N{NO-BREAK SPACE}"
MINUS = "\N{MINUS SIGN}"
DASH = "\N{EN DASH}"
NONE = DASH


def percent(value: float) -> str:
    """A rate in [0, 1] as percent with one decimal, e.g. `70.0 %`."""
    return f"{100 * value:.1f}{NBSP}%"


def bare(value: float) -> str:
    """A rate or a loss without the sign of percent, for tables whose caption says it; a loss may be a gain."""
    return _with_minus(f"{100 * value:.1f}")


def published(value: float) -> str:
    """A published percentage, with the digits that it was published with and at least one, e.g. `1.25 %`."""
    return (f"{value:.1f}" if round(value, 1) == value else f"{value:g}") + f"{NBSP}%"


def interval(rate: Rate | Estimate) -> str:
    """The 95 % interval of a rate in percent, e.g. `39.7–89.2 %`."""
    return f"{100 * rate.low:.1f}{DASH}{100 * rate.high:.1f}{NBSP}%"


def bare_interval(rate: Rate | Estimate) -> str:
    """Its interval, e.g. `−1.2 to 7.4`."""
    return f"{bare(rate.low)} to {bare(rate.high)}"


def points(difference: float) -> str:
    """A difference of rates in percentage points with its sign, e.g. `+7.2`."""
    return _with_minus(f"{100 * difference:+.1f}")


def points_interval(difference: Estimate) -> str:
    """The interval of a difference in percentage points, e.g. `+5.0 to +9.4`."""
    return f"{points(difference.low)} to {points(difference.high)}"


def _with_minus(text: str) -> str:
    return "0.0" if float(text) == 0 else text.replace("-", MINUS)


def p_value(p: float) -> str:
    """A p-value with two significant digits, or an upper bound."""
    if p < 0.001:
        return "< 0.001"
    return f"{p:.2f}" if p >= 0.1 else f"{p:.2g}"


def seconds(value: float | None) -> str:
    """Seconds with one decimal, or a dash for nothing."""
    return NONE if value is None else f"{value:.1f}{NBSP}s"


def count(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun, e.g. `1 task`, `2,500 trials`."""
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def listed(names: list[str] | tuple[str, ...], most: int = 6) -> str:
    """Names as a phrase: `A`, `A and B`, `A, B and C`, or the first ones and how many more."""
    if len(names) > most:
        return ", ".join(names[: most - 1]) + f" and {len(names) - most + 1} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
