"""Statistics against R's values (the call that gives each stands beside it), and on the edges."""

from __future__ import annotations

import numpy as np
import pytest

from robocasa_lerobot.benchmark.published import table
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.statistics import (
    Estimate,
    average_over_tasks,
    linear_combination,
    ratio,
    wilson_interval,
)
from robocasa_lerobot.evaluation.statistics.data_efficiency import demos_for_success, worth_of_pretraining
from robocasa_lerobot.evaluation.statistics.horizon import success_curve, time_to_success
from robocasa_lerobot.evaluation.statistics.lifelong import lifelong
from robocasa_lerobot.evaluation.statistics.paired import compare, exact_mcnemar, paired_difference
from robocasa_lerobot.evaluation.statistics.power import independent_discordance, mcnemar_power, smallest_difference

# R 4.2: prop.test(x, n, correct = FALSE)$conf.int
WILSON = {
    (0, 10): (0.0, 0.277532799863),
    (10, 10): (0.722467200137, 1.0),
    (0, 1): (0.0, 0.793450685623),
    (1, 1): (0.206549314377, 1.0),
    (7, 10): (0.396778147461, 0.892208732594),
    (37, 50): (0.604468427352, 0.841284725064),
    (1, 2500): (7.06133119587e-05, 0.00226238536897),
}


def outcomes(both: int, only_a: int, only_b: int, neither: int) -> tuple[np.ndarray, np.ndarray]:
    a = [True] * both + [True] * only_a + [False] * only_b + [False] * neither
    b = [True] * both + [False] * only_a + [True] * only_b + [False] * neither
    return np.array(a, dtype=bool), np.array(b, dtype=bool)


@pytest.mark.parametrize(("counts", "expected"), WILSON.items())
def test_wilson_is_that_of_r_and_an_average_over_one_task_is_wilson(
    counts: tuple[int, int], expected: tuple[float, float]
) -> None:
    assert wilson_interval(*counts) == pytest.approx(expected, abs=1e-11)
    average = average_over_tasks([counts])
    assert (average.low, average.high) == pytest.approx(expected, abs=1e-11)
    assert average.value == counts[0] / counts[1]


@pytest.mark.parametrize("counts", [(0, 0), (-1, 5), (6, 5)])
def test_impossible_counts_are_refused(counts: tuple[int, int]) -> None:
    with pytest.raises(UserError):
        wilson_interval(*counts)
    with pytest.raises(UserError):
        average_over_tasks([counts])


def test_an_average_weighs_tasks_alike_whatever_their_trials() -> None:
    assert average_over_tasks([(0, 1000), (10, 10)]).value == 0.5
    assert average_over_tasks([(3, 10), (0, 0)]) == average_over_tasks([(3, 10)])
    # Equal rates: the tasks' trials are as good as one task's.
    assert average_over_tasks([(0, 10)] * 25).high == pytest.approx(wilson_interval(0, 250)[1])
    nothing, everything = average_over_tasks([(0, 50)] * 50), average_over_tasks([(50, 50)] * 50)
    assert (nothing.value, nothing.low) == (0, 0)
    assert 0 < nothing.high < 0.002
    assert (everything.value, everything.high) == (1, 1)
    assert 0.998 < everything.low < 1
    with pytest.raises(UserError, match="average of nothing"):
        average_over_tasks([])


@pytest.mark.parametrize(
    ("rates", "trials"),
    [
        ([0.02] * 50, [30] * 50),
        ([0.0] * 40 + [0.3] * 10, [10] * 50),
        ([0.05] * 10 + [0.95] * 10, [50] * 20),
        ([0.1, 0.5, 0.9], [10, 30, 50]),
        ([0.8, 0.5, 0.6, 0.7, 0.3, 0.9], [5, 20, 50, 5, 20, 50]),
    ],
)
def test_the_interval_of_an_average_covers_the_truth_in_about_95_of_100_evaluations(
    rates: list[float], trials: list[int]
) -> None:
    rng = np.random.default_rng(7)
    truth, hits, repeats = float(np.mean(rates)), 0, 600
    for x in rng.binomial(trials, rates, size=(repeats, len(rates))):
        estimate = average_over_tasks(list(zip(x.tolist(), trials, strict=True)))
        hits += estimate.low <= truth <= estimate.high
    # Three standard errors of 600 repeats below 95 % are 2.7 points. Full table: benchmarks/interval_coverage.py.
    assert hits / repeats > 0.923


def test_a_rate_as_a_share_of_another_covers_what_it_says() -> None:
    """Two averages of nine tasks with eight trials each, as a lifelong study has them; and what is 0."""
    before, after = np.linspace(0.0, 0.9, 9), np.linspace(0.0, 0.7, 9)
    rng = np.random.default_rng(5)
    truth, hits, repeats = after.mean() / before.mean(), 0, 600
    for _ in range(repeats):
        kept, reached = (average_over_tasks([(int(x), 8) for x in rng.binomial(8, rates)]) for rates in (after, before))
        share = ratio(kept, reached)
        assert share is not None
        assert share.low <= share.value == pytest.approx(kept.value / reached.value)
        hits += share.low <= truth <= share.high
    assert 0.923 < hits / repeats < 0.99
    nothing, some = Estimate(0.0, 0.0, 0.2), Estimate(0.5, 0.4, 0.6)
    lost = ratio(nothing, some)
    assert lost is not None
    assert (lost.value, lost.low) == (0, 0)
    assert 0.2 / 0.6 < lost.high < 0.2 / 0.4
    assert ratio(some, nothing) is None
    unsure = ratio(some, Estimate(0.5, 0.0, 0.9))
    assert unsure is not None
    assert unsure.high == np.inf
    assert 0.4 / 0.9 < unsure.low < 1


def test_combinations_keep_the_skew_and_turn_ends_with_the_sign() -> None:
    a, b = Estimate(0.0, 0.0, 0.3), Estimate(0.5, 0.4, 0.7)
    difference = linear_combination([a, b], [1, -1])
    assert difference.value == -0.5
    assert difference.low == pytest.approx(-0.5 - 0.2)
    assert difference.high == pytest.approx(-0.5 + np.hypot(0.3, 0.1))
    same = linear_combination([b, b], [1, -1], [[1, 1], [1, 1]])
    assert (same.value, same.low, same.high) == pytest.approx((0, -0.1, 0.1))
    with pytest.raises(UserError):
        linear_combination([], [])


# R: binom.test(b, b + c)$p.value, the exact McNemar test.
@pytest.mark.parametrize(
    ("only_a", "only_b", "p"),
    [
        (5, 15, 0.041389465332),
        (0, 6, 0.03125),
        (0, 5, 0.0625),
        (12, 30, 0.0079158973349),
        (1, 0, 1.0),
        (7, 7, 1.0),
        (0, 0, 1.0),
    ],
)
def test_mcnemar_is_that_of_r(only_a: int, only_b: int, p: float) -> None:
    assert exact_mcnemar(only_a, only_b) == pytest.approx(p, rel=1e-9)
    assert exact_mcnemar(only_b, only_a) == pytest.approx(p, rel=1e-9)


def test_holm_is_that_of_r() -> None:
    # Discordant trials whose exact p-values are 0.0078125, 0.03125, 0.0625 and 1.
    # R: p.adjust(c(0.0078125, 0.03125, 0.0625, 1), "holm")
    pairs = {"A": outcomes(3, 0, 8, 0), "B": outcomes(1, 6, 0, 2), "C": outcomes(0, 5, 0, 9), "D": outcomes(4, 0, 0, 4)}
    result = compare(pairs)
    assert [t.p_holm for t in result.tasks.values()] == pytest.approx([0.03125, 0.09375, 0.125, 1.0])
    overall = result.overall
    assert (overall.pairs, overall.both, overall.only_a, overall.only_b, overall.neither) == (42, 8, 11, 8, 15)
    assert overall.p_value == pytest.approx(exact_mcnemar(11, 8))
    assert overall.p_holm is None
    mean = np.mean([8 / 11, -6 / 9, -5 / 14, 0])
    assert overall.difference.value == pytest.approx(mean)
    assert overall.difference.low < mean < overall.difference.high


def test_paired_differences_cover_the_truth_and_pairs_make_them_narrower() -> None:
    rng, repeats, hits = np.random.default_rng(3), 300, 0
    truth = np.mean([0.1, 0.1, 0.0])
    for _ in range(repeats):
        trials = {}
        for task, (low, high) in {"A": (0.2, 0.3), "B": (0.5, 0.6), "C": (0.02, 0.02)}.items():
            # One draw of luck for both policies, as in trials with one scene.
            luck = rng.random(40)
            trials[task] = (luck < low, luck < high)
        estimate = paired_difference(trials)
        hits += estimate.low <= truth <= estimate.high
    assert hits / repeats > 0.92
    shuffled = {task: (a, rng.permutation(b)) for task, (a, b) in trials.items()}
    narrow, wide = (paired_difference(t) for t in (trials, shuffled))
    assert narrow.high - narrow.low < 0.75 * (wide.high - wide.low)


def test_paired_edges() -> None:
    one = compare({"A": (np.array([True]), np.array([False]))}).overall
    assert (one.p_value, one.difference.value) == (1.0, -1.0)
    assert -1 <= one.difference.low <= -1 < one.difference.high
    same = compare({"A": outcomes(5, 0, 0, 5)}).overall
    assert (same.p_value, same.difference.value) == (1.0, 0.0)
    assert same.difference.low < 0 < same.difference.high
    never = compare({"A": outcomes(0, 0, 0, 10)}).overall
    assert (never.p_value, never.difference.value) == (1.0, 0.0)
    with pytest.raises(UserError, match="no trial in common"):
        compare({"A": (np.zeros(0, bool), np.zeros(0, bool))})
    with pytest.raises(UserError, match="pairs need the same"):
        compare({"A": (np.zeros(2, bool), np.zeros(3, bool))})


# R: sum over m of dbinom(m, n, psi) * sum(dbinom(0:m, m, (psi + d) / (2 psi))[two-sided exact p <= 0.05])
@pytest.mark.parametrize(
    ("pairs", "discordance", "difference", "power"),
    [
        (50, 0.3, 0.2, 0.699305606084),
        (100, 0.2, 0.1, 0.544445427935),
        (20, 0.5, 0.5, 0.979305267334),
        (6, 1.0, 1.0, 1.0),
        (5, 1.0, 1.0, 0.0),
        (200, 0.25, 0.08, 0.577506665011),
        (50, 0.0, 0.0, 0.0),
    ],
)
def test_power_is_that_of_r(pairs: int, discordance: float, difference: float, power: float) -> None:
    assert mcnemar_power(pairs, discordance, difference) == pytest.approx(power, abs=1e-7)
    assert mcnemar_power(pairs, discordance, -difference) == pytest.approx(power, abs=1e-7)


def test_the_smallest_difference_is_found_at_the_power_asked_for() -> None:
    assert smallest_difference(5, 0.2) is None
    for pairs in (6, 50, 2500):
        found = smallest_difference(pairs, 0.2)
        assert found is not None
        assert mcnemar_power(pairs, max(0.2, found), found) >= 0.8
        assert mcnemar_power(pairs, max(0.2, found - 0.01), found - 0.01) < 0.8
    assert independent_discordance(0.5, 0.6) == pytest.approx(0.5)
    with pytest.raises(UserError):
        mcnemar_power(10, 0.1, 0.2)


def test_success_against_time_is_survfit_of_r() -> None:
    # R: summary(survfit(Surv(t, s) ~ 1, conf.type = "log-log")) with
    #    t = c(10, 20, 20, 35, 50, 50, 50, 50, 60, 80), s = c(1, 1, 1, 1, 0, 0, 1, 0, 1, 0)
    curve = success_curve([10, 20, 20, 35, None, None, 50, None, 60, None], [50] * 8 + [80] * 2)
    assert curve.times.tolist() == [10, 20, 35, 50, 60, 80]
    assert curve.rate == pytest.approx([0.1, 0.3, 0.4, 0.5, 0.75, 0.75])
    low = [0.0147186066327, 0.1080509587752, 0.1727790329715, 0.2468259230018, 0.3710522309310]
    high = [0.526990728638, 0.671283406720, 0.747331102996, 0.816394409381, 0.984147892723]
    assert curve.low[:5] == pytest.approx(low, abs=1e-10)
    assert curve.high[:5] == pytest.approx(high, abs=1e-10)
    assert [curve.at(t) for t in (0, 9.9, 10, 34, 1000)] == pytest.approx([0, 0, 0.1, 0.3, 0.75])


def test_success_against_time_on_the_edges() -> None:
    never = success_curve([None] * 10, [50] * 10)
    assert (never.rate.tolist(), never.low.tolist()) == ([0.0], [0.0])
    assert never.high == pytest.approx([WILSON[0, 10][1]])
    always = success_curve([5.0] * 10, [50] * 10)
    assert (always.at(4), always.at(5)) == (0, 1)
    assert always.low == pytest.approx([WILSON[10, 10][0]])
    assert success_curve([3], [5]).low == pytest.approx([WILSON[1, 1][0]])
    with pytest.raises(UserError):
        success_curve([], [])
    # R: quantile(c(3, 7, 8, 20, 21, 50), c(.25, .5, .75))
    times = time_to_success([3, None, 7, 8, 20, 21, 50])
    assert times is not None
    assert (times.first_quartile, times.median, times.third_quartile, times.solved) == (7.25, 14, 20.75, 6)
    assert time_to_success([None]) is None


def test_lifelong_summaries_of_the_published_matrix() -> None:
    published = table("lifelong")
    counts = {
        int(row.key): {
            j: [(round(value * 10), 1000)]
            for j in range(1, 5)
            if (value := published.value(row.key, f"lifelong_phase{j}")) is not None
        }
        for row in published.rows
    }
    result = lifelong(counts)
    assert result.matrix[4][3].value == pytest.approx(0.027)
    assert result.average[4].value == pytest.approx(np.mean([10.6, 1.7, 2.7, 4.3]) / 100)
    assert result.forgetting[4].value == pytest.approx(np.mean([41.5 - 10.6, 24.5 - 1.7, 11.3 - 2.7]) / 100)
    assert result.backward_transfer is not None
    assert result.backward_transfer.value == pytest.approx(-result.forgetting[4].value)
    assert result.backward_transfer.low < result.backward_transfer.value < result.backward_transfer.high
    assert result.forward_transfer is None
    assert 1 not in result.forgetting
    ahead = lifelong({1: {1: [(5, 10)], 2: [(3, 10)]}, 2: {1: [(6, 10)], 2: [(5, 10)]}}, untrained={2: [(1, 10)]})
    assert ahead.forward_transfer is not None
    assert ahead.forward_transfer.value == pytest.approx(0.2)
    assert ahead.average[1].value == pytest.approx(0.5)  # what lies ahead does not count
    assert ahead.backward_transfer is not None
    assert ahead.backward_transfer.value == pytest.approx(0.1)
    assert lifelong({1: {1: [(0, 1)]}}).backward_transfer is None
    # The mean of some phases is not that of all.
    one = [(5, 10)]
    some = lifelong({1: {1: one}, 2: {1: one, 2: one}, 3: {2: one, 3: one}})
    assert (set(some.average), set(some.forgetting), some.backward_transfer) == ({1, 2}, {2}, None)
    gap = lifelong({1: {1: one}, 3: {1: one, 2: one, 3: one}}, untrained={2: one, 3: one})
    assert (gap.forgetting, gap.backward_transfer, gap.forward_transfer) == ({}, None, None)
    # What phase 2 had reached when it was new is not known, so that what it lost is not either.
    lost = lifelong({1: {1: one}, 3: {1: one, 2: one, 3: one}, 4: {1: one, 2: one, 3: one, 4: one}})
    assert lost.forgetting == {}
    with pytest.raises(UserError):
        lifelong({1: {1: [(0, 0)]}})


def test_pretraining_is_worth_about_three_times_the_target_data_in_the_published_curves() -> None:
    published = table("foundation")
    curves: dict[bool, dict[int, float]] = {True: {}, False: {}}
    for column in published.columns:
        value = published.value("average", column.key)
        assert value is not None
        curves[column.facts["pretrained"]][column.facts["target_demos"]] = value
    zero, ten, thirty, hundred = worth_of_pretraining(curves[False], curves[True])
    # Between (150, 34.3) and (500, 43.7), on a logarithmic axis.
    assert ten.equal_demos == pytest.approx(150 * (500 / 150) ** ((35.9 - 34.3) / (43.7 - 34.3)))
    assert ten.factor == pytest.approx(3.68, abs=0.01)
    assert thirty.factor == pytest.approx(2.75, abs=0.01)
    assert (hundred.bound, hundred.equal_demos) == ("at least", 500)
    assert (zero.bound, zero.equal_demos, zero.factor) == ("at most", 50, None)
    assert ten.low is None


def test_data_efficiency_intervals_come_from_the_trials_and_stop_at_the_ends_of_the_curve() -> None:
    def tasks(percent: int) -> list[tuple[int, int]]:
        return [(round(percent / 2), 50)] * 20

    curve = {50: tasks(20), 150: tasks(34), 500: tasks(44)}
    few, many = worth_of_pretraining(curve, {50: tasks(36), 500: tasks(52)}, np.random.default_rng(0))
    again = worth_of_pretraining(curve, {50: tasks(36), 500: tasks(52)}, np.random.default_rng(0))
    assert again == [few, many]
    assert few.low is not None
    assert few.high is not None
    assert 50 < few.low < few.equal_demos < few.high <= 500
    assert (many.bound, many.low_bound, many.high_bound) == ("at least", "at least", "at least")
    with pytest.raises(UserError, match="a curve needs at least two"):
        worth_of_pretraining({50: 0.1}, {50: 0.2})
    demos = np.array([10.0, 100.0, 1000.0])
    # A dip is levelled; on the level piece the fewest demonstrations count.
    assert demos_for_success(demos, np.array([0.2, 0.6, 0.4]), np.array(0.5)) == pytest.approx(100)
    assert demos_for_success(demos, np.array([0.2, 0.4, 0.6]), np.array(0.3)) == pytest.approx(10**1.5)
    assert np.isinf(demos_for_success(demos, np.array([0.2, 0.4, 0.6]), np.array(0.7)))
    assert demos_for_success(demos, np.array([0.2, 0.4, 0.6]), np.array(0.1)) == 0
    assert demos_for_success(demos, np.array([0.0, 0.0, 0.6]), np.array(0.0)) == 0
