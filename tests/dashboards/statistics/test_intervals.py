from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from dashboards.statistics.intervals import (
    bootstrap,
    interquartile_mean,
    quantile_interval,
    resampled_interquartile_mean,
)

times = st.lists(st.floats(1e-3, 1e4), min_size=1, max_size=60).map(np.array)


def test_the_bootstrap_interval_of_a_mean_is_the_textbook_one() -> None:
    drawn = np.random.default_rng(0).normal(10.0, 2.0, (400, 1))
    resampled = bootstrap(drawn, drawn, seed=0, resamples=4000)
    assert resampled.means.std() == pytest.approx(drawn.std() / 20.0, rel=0.05)
    assert (resampled.reductions == 0.0).all()


def test_the_bootstrap_intervals_are_scipy_s() -> None:
    drawn = np.random.default_rng(1).lognormal(0.0, 1.0, (200, 1))
    resampled = bootstrap(drawn, drawn, seed=0, resamples=5000, interquartile=True)
    for mine, statistic in (
        (resampled.means, np.mean),
        (resampled.interquartile_means, lambda x, axis: stats.trim_mean(x, 0.25, axis=axis)),
    ):
        theirs = stats.bootstrap(
            (drawn[:, 0],), statistic, n_resamples=5000, method="percentile", rng=np.random.default_rng(2)
        ).confidence_interval
        spread = theirs.high - theirs.low
        ends = np.quantile(mine, [0.025, 0.975])
        assert ends == pytest.approx([theirs.low, theirs.high], abs=0.05 * spread)


@given(quarters=st.integers(1, 15), seed=st.integers(0, 99))
def test_the_interquartile_mean_is_scipy_s_trimmed_mean(quarters: int, seed: int) -> None:
    values = np.random.default_rng(seed).lognormal(size=4 * quarters)
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25))


@given(values=times, seed=st.integers(0, 99))
def test_a_resampled_interquartile_mean_is_that_of_the_drawn_values(values: np.ndarray, seed: int) -> None:
    n = len(values)
    counts = np.bincount(np.random.default_rng(seed).integers(n, size=n), minlength=n)
    drawn = np.repeat(values, counts)
    order = np.argsort(values)
    mine = resampled_interquartile_mean(values[order], counts[order, None].astype(float))
    assert mine[0] == pytest.approx(interquartile_mean(drawn))
    assert values.min() * (1 - 1e-9) <= mine[0] <= values.max() * (1 + 1e-9)


@given(values=times)
def test_an_outlier_moves_no_interquartile_mean(values: np.ndarray) -> None:
    many = np.concatenate([values] * 8)
    outlier = many.copy()
    outlier[np.argmax(many)] = 1e5
    assert interquartile_mean(outlier) == pytest.approx(interquartile_mean(many))


@settings(max_examples=10)
@given(n=st.integers(5, 60), share=st.sampled_from([0.5, 0.9]), seed=st.integers(0, 99))
def test_the_interval_of_a_quantile_is_that_of_many_resamples(n: int, share: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = np.sort(rng.lognormal(size=n))
    drawn = values[rng.integers(n, size=(20_000, n))]
    resampled = np.quantile(drawn, share, axis=1, method="inverted_cdf")
    low, high = quantile_interval(values, share)
    for end, tail in ((low, 0.025), (high, 0.975)):  # each an order statistic: on the tail but for chance
        assert (resampled < end).mean() <= tail + 0.006
        assert (resampled <= end).mean() >= tail - 0.006


@given(values=times, share=st.sampled_from([0.5, 0.9]))
def test_the_interval_of_a_quantile_holds_it(values: np.ndarray, share: float) -> None:
    low, high = quantile_interval(values, share)
    assert low <= np.quantile(values, share, method="inverted_cdf") <= high
    assert {low, high} <= set(values)


def test_what_was_not_attempted_counts_nowhere() -> None:
    there = np.random.default_rng(0).lognormal(size=30)
    gaps = np.concatenate([there, np.full(10, np.nan)])
    assert interquartile_mean(gaps) == interquartile_mean(there)
    assert quantile_interval(gaps, 0.5) == quantile_interval(there, 0.5)
    nothing = np.full(3, np.nan)
    assert np.isnan([interquartile_mean(nothing), *quantile_interval(nothing, 0.5)]).all()
