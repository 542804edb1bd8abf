"""Inverted lists over the readout: they find the plans that score best without scoring all of them.

Rows ``(w, b)`` that are near each other stand in one list, and only the lists whose centres score best for an
embedding are searched (Sivic and Zisserman 2003; Jegou, Douze and Schmid 2011, IVF). This is approximate: a
plan in another list may score better. docs/studies/growth.md says when it pays, and compares libraries.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.memory.ranking.scores import insert
from planners.world.arrays import Floats32, Indices, Integers
from planners.world.jit import inlined, lean
from planners.world.randomness import generator

FROM_PLANS: Final = 20_000  # with fewer plans, scoring all is as fast
PROBES: Final = 32  # lists searched: hit rates are within 1 % of those of scoring all plans
ROUNDS: Final = 10  # of k-means; the lists need not be optimal
SAMPLE: Final = 64  # rows for each list that k-means uses
_BLOCK: Final = 4096  # rows that are assigned to lists at once


class InvertedLists(NamedTuple):
    """N plans' rows in L lists, one list after another."""

    centres: Floats32  # [L, D + 1] mean row of each list
    starts: Integers  # [L + 1] list l owns rows[starts[l] : starts[l + 1]]
    plans: Integers  # [N] the plan that each row belongs to
    rows: Floats32  # [N, D + 1] vector and bias


def list_readout(vectors: Floats32, biases: Floats32) -> InvertedLists:
    """Make the lists of a readout, ``vectors [N + 1, D]`` and ``biases [N + 1]``, by k-means.

    The same readout always gives the same lists.
    """
    rows = _rows(vectors, biases)
    count = min(len(rows), int(4 * np.sqrt(len(rows))))  # scoring centres then costs as much as their lists
    rng = generator(0, "inverted-lists")
    finite = np.where(np.isfinite(rows), rows, np.float32(0.0))  # plans that are never ranked have none
    sample = finite[np.sort(rng.choice(len(rows), min(len(rows), SAMPLE * count), replace=False))]
    centres = sample[rng.choice(len(sample), count, replace=False)]
    for _ in range(ROUNDS):
        nearest = _nearest(sample, centres)
        sizes = np.bincount(nearest, minlength=count)
        sums = np.zeros(centres.shape)
        np.add.at(sums, nearest, sample)
        centres = np.where(sizes[:, np.newaxis] > 0, sums / np.maximum(sizes, 1)[:, np.newaxis], centres)
        centres = centres.astype(np.float32)
    nearest = _nearest(finite, centres)
    plans = np.argsort(nearest, kind="stable").astype(np.int32)
    starts = np.concatenate(([0], np.cumsum(np.bincount(nearest, minlength=count)))).astype(np.int32)
    return InvertedLists(centres, starts, plans, rows[plans])


def lists_with(
    centres: Floats32, starts: Integers, plans: Integers, vectors: Floats32, biases: Floats32
) -> InvertedLists:
    """Make lists of a readout from parts that were made before. Raises ValueError if they do not fit it."""
    rows = _rows(vectors, biases)
    fitting = (
        [each.dtype.str for each in (centres, starts, plans)] == ["<f4", "<i4", "<i4"]
        and centres.shape == (len(starts) - 1, rows.shape[1])
        and plans.shape == (len(rows),)
        and np.array_equal(np.sort(plans), np.arange(len(rows)))
        and (starts[0], starts[-1]) == (0, len(rows))
        and bool((np.diff(starts) >= 0).all())
    )
    if not fitting:
        raise ValueError(f"inverted lists do not belong to {len(rows)} plans")
    return InvertedLists(centres, starts, plans, rows[plans])


def _rows(vectors: Floats32, biases: Floats32) -> Floats32:
    return np.column_stack((vectors[1:], biases[1:]))


def _nearest(rows: Floats32, centres: Floats32) -> Indices:
    """The number ``[n]`` of the centre nearest to each row."""
    halves = 0.5 * np.square(centres).sum(1)
    starts = range(0, len(rows), _BLOCK)  # all at once would take 16 GB for a million plans
    return np.concatenate([np.argmax(rows[i : i + _BLOCK] @ centres.T - halves, axis=1) for i in starts])


@inlined
def _score(row: Floats32, embedding: Floats32) -> float:
    score: float = row[embedding.shape[0]]
    for k in range(embedding.shape[0]):
        score += row[k] * embedding[k]
    return score


@lean
def _search(
    lists: InvertedLists,
    embedding: Floats32,
    probed: Integers,
    list_scores: Floats32,
    best: Integers,
    scores: Floats32,
) -> int:
    probes = 0
    for i in range(lists.centres.shape[0]):
        probes = insert(i, _score(lists.centres[i], embedding), probes, probed, list_scores)
    count = 0
    for i in range(probes):
        for r in range(lists.starts[probed[i]], lists.starts[probed[i] + 1]):
            count = insert(lists.plans[r], _score(lists.rows[r], embedding), count, best, scores)
    return count


def best_listed(lists: InvertedLists, embedding: Floats32, k: int, probes: int = PROBES) -> Integers:
    """Find (nearly) the ``k`` plans that score best for an embedding ``[D]``, best first.

    There are fewer if the searched lists hold fewer.
    """
    best, scores = np.empty(k, np.int32), np.empty(k, np.float32)
    probes = min(probes, len(lists.centres))
    count = _search(lists, embedding, np.empty(probes, np.int32), np.empty(probes, np.float32), best, scores)
    return best[:count]
