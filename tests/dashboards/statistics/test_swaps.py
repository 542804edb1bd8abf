"""Differences judged by swapping sides: how often one is found, be there one or not."""

from __future__ import annotations

import numpy as np
import pytest

from dashboards.statistics.swaps import differences


def noise(rng: np.random.Generator, problems: int, columns: int) -> np.ndarray:
    """Paired times with rare long ones, of a machine that becomes slower, in an order that was drawn."""
    hard = rng.lognormal(0.0, 1.0, (problems, 1))
    drift = np.linspace(1.0, 5.0, problems)[:, np.newaxis]
    first, other = (hard * drift * rng.pareto(1.5, (problems, columns)) for _ in range(2))
    return first - other


def test_among_many_families_without_a_difference_few_find_one() -> None:
    rng, found = np.random.default_rng(0), 0
    for number in range(300):
        (one, two) = differences([noise(rng, 60, 12), noise(rng, 40, 5)], number, drawn=400)
        found += bool(((one.low > 0) | (one.high < 0)).any() or ((two.low > 0) | (two.high < 0)).any())
    assert found / 300 <= 0.08  # 5 %, and three standard errors


def test_a_difference_is_found_and_its_interval_holds_it() -> None:
    rng = np.random.default_rng(2)
    given = rng.normal(0.0, 1.0, (200, 6))
    given[:, 2] += 0.5
    (found,) = differences([given])
    assert np.flatnonzero((found.low > 0) | (found.high < 0)).tolist() == [2]
    assert found.low[2] < 0.5 < found.high[2]
    np.testing.assert_allclose(found.mean, given.mean(0))


def test_missing_sides_are_left_out_and_equal_ones_do_not_differ() -> None:
    given = np.full((30, 3), np.nan)
    given[:10, 0], given[:, 1] = 1.0, 0.0
    (found,) = differences([given])
    assert found.mean[0] == 1.0
    assert (found.mean[1], found.low[1], found.high[1]) == (0.0, 0.0, 0.0)
    assert np.isnan([found.mean[2], found.low[2], found.high[2]]).all()


@pytest.mark.parametrize("families", [[], [np.zeros((0, 2))]])
def test_nothing_to_compare_is_no_error(families: list[np.ndarray]) -> None:
    assert len(differences(families)) == len(families)
