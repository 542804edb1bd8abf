from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.plans.plan_arrays import StoredPlans, store_plans
from planners.world.problem import Plan
from planners.world.randomness import generator


def some_plans(seed, lengths):
    rng = generator(seed, "stored")
    return [Plan(rng.random((n, 5)), rng.random((n - 1, 2)), float(rng.random())) for n in lengths]


def assert_same(stored, plan):
    np.testing.assert_array_equal(stored.states, plan.states)
    np.testing.assert_array_equal(stored.controls, plan.controls)
    assert stored.dt == plan.dt


@given(seed=st.integers(0, 2**32 - 1), lengths=st.lists(st.integers(1, 20), max_size=10))
def test_stored_plans_are_the_plans_that_were_stored(seed, lengths):
    plans = some_plans(seed, lengths)
    stored = store_plans(plans, 5)
    assert len(stored) == len(plans)
    for i, (lazily, eagerly) in enumerate(zip(stored, plans, strict=True)):
        assert_same(lazily, eagerly)
        assert_same(stored[i - len(plans)], eagerly)


@pytest.mark.parametrize("mode", ["r", "c"])
def test_plans_read_from_a_mapped_file_are_the_plans_that_were_stored(tmp_path, mode):
    plans = some_plans(1, [3, 1, 7])
    stored = store_plans(plans, 5)
    arrays = []
    for name in ("states", "controls", "starts", "dt"):
        np.save(tmp_path / f"{name}.npy", getattr(stored, name))
        arrays.append(np.load(tmp_path / f"{name}.npy", mmap_mode=mode, allow_pickle=False))
    mapped = StoredPlans(*arrays)
    for lazily, eagerly in zip(mapped, plans, strict=True):
        assert_same(lazily, eagerly)
    assert [len(plan.states) for plan in mapped[1:]] == [1, 7]


def test_a_plan_is_a_view():
    stored = store_plans(some_plans(2, [4, 5]), 5)
    assert np.shares_memory(stored[1].states, stored.states)
    assert store_plans(stored, 5) is stored


@given(first=st.integers(-6, 6) | st.none(), last=st.integers(-6, 6) | st.none())
def test_a_slice_is_a_view_of_the_plans_of_a_slice(first, last):
    plans = some_plans(5, [4, 1, 5, 2])
    stored = store_plans(plans, 5)
    part = stored[first:last]
    for lazily, eagerly in zip(part, plans[first:last], strict=True):
        assert_same(lazily, eagerly)
    assert len(part) == 0 or np.shares_memory(part.states, stored.states)


def test_no_plan_is_beyond_the_last():
    stored = store_plans(some_plans(3, [4]), 5)
    with pytest.raises(IndexError):
        stored[1]
    assert not stored[5:]


@pytest.mark.parametrize(
    "change",
    [
        {"starts": np.array([0, 4, 8])},
        {"starts": np.array([0, 9])},
        {"starts": np.array([1, 4, 9])},
        {"starts": np.array([0, 0, 9])},
        {"controls": np.zeros((8, 2))},
        {"dt": np.zeros(3)},
        {"states": np.zeros(9)},
    ],
)
def test_arrays_that_do_not_fit_are_refused(change):
    stored = store_plans(some_plans(4, [4, 5]), 5)
    arrays = {name: getattr(stored, name) for name in ("states", "controls", "starts", "dt")}
    with pytest.raises(ValueError, match="one control fewer"):
        StoredPlans(**(arrays | change))
