"""What a best-first search drives next: a heap of motions, and a table of the states that it has reached."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats, Indices
from planners.world.jit import inlined, lean

CAPACITY: Final = 1 << 17  # motions that may wait; more are forgotten
_TABLE_BITS: Final = 16
_TO_SLOT: Final = np.uint64(64 - _TABLE_BITS)
_GOLDEN: Final = np.uint64(0x9E3779B97F4A7C15)  # Fibonacci hashing (Knuth, TAOCP 3, 6.4)
# indices into Frontier.counts
WAITING, SEARCH = range(2)
# columns of Frontier.reached
_KEY, _SEARCH = range(2)


class Frontier(NamedTuple):
    """Motions in a binary heap, the least estimate first, and keys of the states that were reached.

    The table holds one key a slot, so it forgets a key when another one falls into its slot. Then a state is
    reached twice, which costs time and nothing else. What earlier searches left in a slot counts for nothing
    and is overwritten like an empty one, so a search does not depend on those before it.
    """

    estimates: Floats  # [CAPACITY] what a solution through the motion would cost
    vertices: Indices  # [CAPACITY] of the tree, from which the motion begins
    motions: Indices  # [CAPACITY]
    reached: Indices  # [2^_TABLE_BITS, 2] a key, and the number of the search that reached it, from 1 on
    counts: Indices  # [2] motions that wait; the number of this search


def allocate_frontier() -> Frontier:
    """Buffers for one search at a time."""
    return Frontier(
        np.empty(CAPACITY),
        np.empty(CAPACITY, np.int64),
        np.empty(CAPACITY, np.int64),
        np.zeros((1 << _TABLE_BITS, 2), np.int64),
        np.array([0, 1], np.int64),
    )


@lean
def clear_frontier(frontier: Frontier) -> None:
    """Begin a new search: nothing waits, nothing was reached."""
    frontier.counts[WAITING] = 0
    frontier.counts[SEARCH] += 1


@inlined
def is_empty(frontier: Frontier) -> bool:
    """Whether nothing waits."""
    return bool(frontier.counts[WAITING] == 0)


@inlined
def _slot(key: int) -> int:
    return int((np.uint64(key) * _GOLDEN) >> _TO_SLOT)


@inlined
def was_reached(frontier: Frontier, key: int) -> bool:
    """Whether a state with this key was reached in this search, as far as the table remembers."""
    slot = _slot(key)
    known, search = frontier.reached[slot, _KEY], frontier.reached[slot, _SEARCH]
    return bool(known == key and search == frontier.counts[SEARCH])


@inlined
def reach(frontier: Frontier, key: int) -> None:
    """Remember that a state with this key was reached."""
    slot = _slot(key)
    frontier.reached[slot, _KEY] = key
    frontier.reached[slot, _SEARCH] = frontier.counts[SEARCH]


@inlined
def push(frontier: Frontier, estimate: float, vertex: int, motion: int) -> None:
    """Let a motion wait. If too many wait already, it is forgotten."""
    at = frontier.counts[WAITING]
    if at == frontier.estimates.shape[0]:
        return
    frontier.counts[WAITING] += 1
    while at > 0:
        parent = (at - 1) // 2
        if frontier.estimates[parent] <= estimate:
            break
        _move(frontier, parent, at)
        at = parent
    frontier.estimates[at] = estimate
    frontier.vertices[at] = vertex
    frontier.motions[at] = motion


@inlined
def pop(frontier: Frontier) -> tuple[int, int]:
    """Take the motion with the least estimate: its vertex and its number. The frontier must not be empty."""
    vertex = frontier.vertices[0]
    motion = frontier.motions[0]
    last = frontier.counts[WAITING] - 1
    frontier.counts[WAITING] = last
    estimate = frontier.estimates[last]
    at = 0
    while True:
        child = 2 * at + 1
        if child + 1 < last and frontier.estimates[child + 1] < frontier.estimates[child]:
            child += 1
        if child >= last or frontier.estimates[child] >= estimate:
            break
        _move(frontier, child, at)
        at = child
    _move(frontier, last, at)
    return vertex, motion


@inlined
def _move(frontier: Frontier, source: int, target: int) -> None:
    frontier.estimates[target] = frontier.estimates[source]
    frontier.vertices[target] = frontier.vertices[source]
    frontier.motions[target] = frontier.motions[source]
