from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from dashboards.statistics.sign_tests import holm, signs

solved_or_not = st.sampled_from([0.5, 1.0, 1.5, 2.0, np.inf, np.nan])
paired = st.lists(st.tuples(solved_or_not, solved_or_not), min_size=1, max_size=60).map(np.array)
p_values = st.lists(st.floats(0.0, 1.0) | st.just(np.nan), min_size=1, max_size=12).map(np.array)


@given(pairs=paired)
def test_the_sign_test_is_scipy_s(pairs: np.ndarray) -> None:
    found = signs(pairs[:, 0], pairs[:, 1])
    both = pairs[~np.isnan(pairs).any(axis=1)]
    slower, faster = (both[:, 0] > both[:, 1]).sum(), (both[:, 0] < both[:, 1]).sum()
    assert found.compared == len(both)
    if len(both) and slower + faster:
        assert found.p_value == pytest.approx(binomtest(slower, slower + faster).pvalue)
        assert found.slower == slower / len(both)
    elif len(both):
        assert found.p_value == 1.0


@given(pairs=paired)
def test_a_slowdown_is_one_and_infinite_only_by_failures(pairs: np.ndarray) -> None:
    found = signs(pairs[:, 0], pairs[:, 1])
    if found.slower > 0.0:
        assert found.slowdown > 1.0
        assert np.isfinite(found.slowdown) or np.isinf(pairs[:, 0]).any()
    else:
        assert np.isnan(found.slowdown)


def test_a_failure_is_slower_than_every_success_and_ties_with_a_failure() -> None:
    fast, slow = np.full(10, 1.0), np.full(10, 5.0)
    failed = np.full(10, np.inf)
    assert signs(failed, slow).slower == 1.0
    assert signs(fast, failed).slower == 0.0
    assert signs(failed, failed) == (10, 0.0, pytest.approx(np.nan, nan_ok=True), 1.0)


@given(p=p_values)
def test_holm_rejects_what_its_step_down_procedure_rejects(p: np.ndarray) -> None:
    corrected = holm(p)
    tested = np.sort(p[~np.isnan(p)])
    for level in (0.001, 0.05, 0.3):
        rejected = 0  # the textbook: from the least on, as long as p <= level / tests left
        while rejected < len(tested) and tested[rejected] <= level / (len(tested) - rejected) * (1 - 1e-12):
            rejected += 1
        assert (corrected <= level * (1 - 1e-13)).sum() >= rejected
        assert (corrected < level * (1 - 1e-9)).sum() <= rejected
    assert (np.isnan(corrected) == np.isnan(p)).all()


@given(p=p_values)
def test_holm_lies_between_no_correction_and_bonferroni_s(p: np.ndarray) -> None:
    tests = np.count_nonzero(~np.isnan(p))
    there = ~np.isnan(p)
    assert (holm(p)[there] >= p[there]).all()
    assert (holm(p)[there] <= np.minimum(1.0, tests * p[there]) + 1e-12).all()
