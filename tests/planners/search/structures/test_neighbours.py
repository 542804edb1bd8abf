import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.search.structures.neighbours import (
    NEWEST,
    allocate_buckets,
    clear_buckets,
    nearest,
    nearest_for,
    nearest_k,
    put,
    remove,
)
from planners.world.problem import BOUNDS

SPARSE = st.integers(1, NEWEST)  # no bucket can overflow, so the answer is exact


def strew(seed, count):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-7, 57, (count, 2))
    buckets = allocate_buckets()
    clear_buckets(buckets, np.array(BOUNDS), 2.0)
    for i in range(count):
        put(buckets, i, *points[i])
    return points, buckets, rng.uniform(-10, 60, 2)


@given(st.integers(0, 10**6), SPARSE)
def test_the_nearest_point_is_the_one_a_linear_scan_finds(seed, count):
    points, buckets, at = strew(seed, count)
    assert nearest(buckets, *at) == np.argmin(np.hypot(*(points - at).T))


@given(st.integers(0, 10**6), SPARSE, st.floats(0.0, 2.0 * np.pi), st.floats(0.0, 0.999))
def test_no_other_point_becomes_nearer_within_the_distance_that_is_told(seed, count, direction, share):
    points, buckets, at = strew(seed, count)
    best, far = nearest_for(buckets, *at)
    assert best == np.argmin(np.hypot(*(points - at).T))
    step = min(share * far, 100.0)
    moved = at + step * np.array([np.cos(direction), np.sin(direction)])
    distances = np.hypot(*(points - moved).T)
    assert distances[best] <= distances.min() + 1e-9


@given(st.integers(0, 10**6), SPARSE, st.integers(1, 8))
def test_the_k_nearest_come_in_order_and_none_is_missed(seed, count, k):
    points, buckets, at = strew(seed, count)
    items, distances = np.empty(k, np.int64), np.empty(k)
    found = nearest_k(buckets, at[0], at[1], items, distances)
    expected = np.sort(np.hypot(*(points - at).T))[:k]
    assert found == min(k, count)
    np.testing.assert_allclose(distances[:found], expected)
    np.testing.assert_allclose(np.hypot(*(points[items[:found]] - at).T), expected)


@given(st.integers(0, 10**6), SPARSE)
def test_a_removed_point_is_never_found_again(seed, count):
    points, buckets, at = strew(seed, count)
    gone = nearest(buckets, *at)
    remove(buckets, gone, *points[gone])
    left = np.delete(np.arange(count), gone)
    found = nearest(buckets, *at)
    assert found == (left[np.argmin(np.hypot(*(points[left] - at).T))] if len(left) else -1)


def test_a_crowded_bucket_keeps_its_newest_points():
    points = np.tile([[10.0, 10.0]], (100, 1)) + np.linspace(0, 0.5, 100)[:, None]
    buckets = allocate_buckets()
    clear_buckets(buckets, np.array(BOUNDS), 2.0)
    for i in range(100):
        put(buckets, i, *points[i])
    assert nearest(buckets, 10.0, 10.0) == 100 - NEWEST
