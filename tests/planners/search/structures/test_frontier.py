"""The frontier of a best-first search, beside Python's own heap."""

import heapq

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


@given(st.lists(st.integers(1, 2**60), max_size=40), st.integers(1, 2**60))
def test_only_what_was_reached_is_remembered(keys, other):
    frontier = allocate_frontier()
    for key in keys:
        reach(frontier, key)
        assert was_reached(frontier, key)
    assert not was_reached(frontier, other) or other in keys
