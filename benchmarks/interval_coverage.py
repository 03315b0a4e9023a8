"""How often does a 95 % interval of an average over tasks hold the true average? Five methods, one table.

    python benchmarks/interval_coverage.py    # a minute; writes benchmarks/results/interval_coverage.json

Each scenario fixes the true success rates of its tasks. Trials are drawn from them many times, and each method's
interval is asked whether it holds the average of the true rates. Good is: never much below 95 %, and narrow.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import common
import numpy as np
from numpy.typing import NDArray
from statsmodels.stats.proportion import proportion_confint

Array = NDArray[np.float64]
OUT = common.RESULTS / "interval_coverage.json"
RESAMPLES = 400
Z = 1.959963984540054


def scenarios() -> dict[str, tuple[Array, Array]]:
    """Name -> true rates and trials of the tasks."""
    from robocasa_lerobot.benchmark.published import per_task_rates

    best = np.array(list(per_task_rates().values())) / 100
    out = {}
    for trials in (10, 30, 50):
        n = np.full(50, trials)
        out[f"50 tasks as the best published policy, {trials} trials"] = (best, n)
        out[f"50 tasks at 2 %, {trials} trials"] = (np.full(50, 0.02), n)
        out[f"40 tasks at 0 %, 10 at 30 %, {trials} trials"] = (np.repeat([0.0, 0.3], [40, 10]), n)
        out[f"16 tasks at 0.2 %, {trials} trials"] = (np.full(16, 0.002), n[:16])
        out[f"18 atomic tasks of the best published policy, {trials} trials"] = (best[:18], n[:18])
        out[f"half of 20 tasks at 5 %, half at 95 %, {trials} trials"] = (np.repeat([0.05, 0.95], 10), n[:20])
        out[f"3 tasks at 10, 50, 90 %, {trials} trials"] = (np.array([0.1, 0.5, 0.9]), n[:3])
        out[f"1 task at 50 %, {trials} trials"] = (np.array([0.5]), n[:1])
    mixed = np.resize([5, 20, 50], 18)
    out["18 atomic tasks of the best published policy, 5, 20 or 50 trials"] = (best[:18], mixed)
    return out


def pooled_wilson(x: Array, n: Array, _: np.random.Generator) -> tuple[Array, Array]:
    """Wilson over all trials, as if they were of one task."""
    return proportion_confint(x.sum(1), n.sum(), method="wilson")


def variance_sum(x: Array, n: Array, _: np.random.Generator) -> tuple[Array, Array]:
    """Normal interval from the sum of the tasks' variances."""
    p = x / n
    half = Z * np.sqrt((p * (1 - p) / n).sum(1)) / x.shape[1]
    return p.mean(1) - half, p.mean(1) + half


def bootstrap_in_tasks(x: Array, n: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Percentile bootstrap within tasks; drawing 0/1 trials again is drawing their binomial count."""
    low, high = np.empty(len(x)), np.empty(len(x))
    for i, row in enumerate(x):
        means = (rng.binomial(n.astype(int), row / n, size=(RESAMPLES, len(n))) / n).mean(1)
        low[i], high[i] = np.quantile(means, [0.025, 0.975])
    return low, high


def square_and_add(x: Array, n: Array, _: np.random.Generator) -> tuple[Array, Array]:
    """Newcombe's square-and-add over the tasks' Wilson intervals."""
    p = x / n
    low, high = proportion_confint(x, np.broadcast_to(n, x.shape), method="wilson")
    k = x.shape[1]
    return p.mean(1) - np.sqrt(((p - low) ** 2).sum(1)) / k, p.mean(1) + np.sqrt(((high - p) ** 2).sum(1)) / k


def wilson_of_effective_trials(x: Array, n: Array, _: np.random.Generator) -> tuple[Array, Array]:
    """Wilson with the number of trials that one task would need for the same variance."""
    p, shrunk = x / n, (x + 0.5) / (n + 1)
    centre, variance = shrunk.mean(1), (shrunk * (1 - shrunk) / n).sum(1) / x.shape[1] ** 2
    effective = centre * (1 - centre) / variance
    return proportion_confint(p.mean(1) * effective, effective, method="wilson")


METHODS: dict[str, Callable[[Array, Array, np.random.Generator], tuple[Array, Array]]] = {
    f.__name__: f for f in (pooled_wilson, variance_sum, bootstrap_in_tasks, square_and_add, wilson_of_effective_trials)
}


def measure(repeats: int, seed: int) -> dict[str, dict[str, dict[str, float]]]:
    """Scenario -> method -> coverage, share of misses on each side, and mean width in percentage points."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for number, (name, (rates, trials)) in enumerate(scenarios().items()):
        rng = np.random.default_rng([seed, number])
        x = rng.binomial(trials, rates, size=(repeats, len(rates))).astype(np.float64)
        n, truth = trials.astype(np.float64), rates.mean()
        table[name] = {}
        for method, function in METHODS.items():
            low, high = (np.asarray(end) for end in function(x, n, rng))
            above, below = low > truth + 1e-12, high < truth - 1e-12
            table[name][method] = {
                "coverage": round(float(1 - above.mean() - below.mean()), 4),
                "interval_too_high": round(float(above.mean()), 4),
                "interval_too_low": round(float(below.mean()), 4),
                "width_points": round(float(100 * (high - low).mean()), 2),
            }
    return table


def main() -> None:
    """Simulate, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=4000, help="simulated evaluations of each scenario")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT)
    args = parser.parse_args()
    table = measure(args.repeats, args.seed)
    for name, row in table.items():
        print(name)
        for method, values in row.items():
            print(f"   {method:27} {100 * values['coverage']:5.1f} %   width {values['width_points']:5.1f}")
    worst = {m: min(row[m]["coverage"] for row in table.values()) for m in METHODS}
    width = {
        m: float(np.mean([row[m]["width_points"] / row["pooled_wilson"]["width_points"] for row in table.values()]))
        for m in METHODS
    }
    result = {
        "ratios": {f"width of {m} / pooled Wilson": round(width[m], 3) for m in METHODS if m != "pooled_wilson"},
        "worst_coverage": worst,
        "scenarios": table,
        "repeats": args.repeats,
        "seed": args.seed,
        "machine": common.machine(),
        "versions": common.versions("numpy", "scipy", "statsmodels"),
    }
    common.write_result(args.out, "interval_coverage", result)
    print("worst coverage:", worst, "\nmean width beside pooled Wilson:", width)


if __name__ == "__main__":
    main()
