"""The frontier of a best-first search, beside Python's own heap."""

import heapq

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.search.structures.frontier import (
    allocate_frontier,
    clear_frontier,
    is_empty,
    pop,
    push,
    reach,
    was_reached,
)

FRONTIER = allocate_frontier()


@given(st.lists(st.one_of(st.none(), st.floats(0, 1e6)), max_size=60))
def test_motions_come_back_by_their_estimates(steps):
    clear_frontier(FRONTIER)
    heap = []
    for number, estimate in enumerate(steps):
        if estimate is not None:
            push(FRONTIER, estimate, number, number)
            heapq.heappush(heap, estimate)
        elif heap:
            vertex, motion = pop(FRONTIER)
            assert vertex == motion
            assert steps[vertex] == heapq.heappop(heap)
        assert is_empty(FRONTIER) == (not heap)


@given(st.lists(st.integers(0, 2**60), max_size=40), st.integers(0, 2**60))
def test_only_what_was_reached_is_remembered(keys, other):
    frontier = allocate_frontier()
    for key in keys:
        reach(frontier, key)
        assert was_reached(frontier, key)
    assert not was_reached(frontier, other) or other in keys


def test_a_search_remembers_and_forgets_as_if_it_were_the_first():
    rng = np.random.default_rng(0)
    used = allocate_frontier()
    keys = rng.integers(0, 2**60, 2000).tolist()
    memories = []
    for frontier in (used, used, allocate_frontier()):
        clear_frontier(frontier)
        assert not any(was_reached(frontier, key) for key in keys)
        for key in keys:
            reach(frontier, key)
        memories.append([was_reached(frontier, key) for key in keys])
        clear_frontier(frontier)
        for key in rng.integers(0, 2**60, 2000).tolist():
            reach(frontier, key)
    assert memories[0] == memories[1] == memories[2]
    assert 0 < memories[0].count(False) < 100
