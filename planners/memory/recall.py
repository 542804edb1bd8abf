"""Recall: which stored plans to try on a problem, by one of five strategies (paper, III-C is ``centroid``).

| strategy | who ranks | who decides |
|---|---|---|
| centroid | the encoder | exact checks of the first k |
| mask | blocked cells | exact checks of the first k |
| hybrid | the encoder some hundred, among these blocked cells | exact checks of them all |
| exhaustive | blocked cells | exact checks of all N |
| random | nobody | exact checks of k picked blindly |

Of a large memory, ``hybrid`` and ``exhaustive`` try the first thousand plans before they ask for more: where
plans are free at all, one of these mostly is, so the time to find it does not grow with the memory.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import rank_by_cells
from planners.memory.plans.fit import ends_of, first_fitting, first_fitting_drawn
from planners.memory.ranking.inverted_lists import best_listed
from planners.memory.ranking.scores import best_plans
from planners.world.arrays import Integers
from planners.world.geometry.occupancy import Grid, bits_of
from planners.world.view import View

RECALLS: Final = ("centroid", "exhaustive", "mask", "hybrid", "random")
CANDIDATES: Final = 256  # plans that hybrid has the encoder choose
MOST_EXHAUSTIVE: Final = 10_000  # plans: with more, ranking by cells costs more than the encoder
ASKED_FIRST: Final = 1_000  # plans of a large memory
TRIED_FIRST: Final = 64  # of these, the least blocked: where these are blocked, the others mostly are
TRIED_DRAWN: Final = 8  # plans checked from the drawing; if all are blocked, a planner will need the scene
WORTH_CELLS: Final = 40  # blocked cells: of plans with 30 or more none was free, in no class


class Recalled(NamedTuple):
    """What a memory has for a problem."""

    plans: tuple[int, ...]  # at most k, best first
    free: int  # one of these that answers the problem; -1: none of all that were checked does
    checks: int  # collision checks to know


def default_recall(memory: Memory) -> str:
    """The strategy that measures best for the size of a memory (docs/method.md)."""
    return "exhaustive" if len(memory.plans) <= MOST_EXHAUSTIVE else "hybrid"


def recall(
    memory: Memory,
    view: View,
    strategy: str,
    k: int,
    rng: np.random.Generator | None = None,
    candidates: int = CANDIDATES,
) -> Recalled:
    """The (at most) ``k`` best plans for a problem and the first that is free, by a strategy of ``RECALLS``.

    Few or none where the strategy holds that no plan fits: ``centroid`` where "no plan" scores best, the
    others leave out plans with more blocked cells than ``WORTH_CELLS``. Cells hold only for plans as
    they are stored: for a problem of another start heading the encoder ranks in their place. ``random``
    needs an ``rng``; ``candidates`` are those of ``hybrid``. ValueError: an unknown strategy, k below 1.
    """
    if strategy not in RECALLS or k < 1:
        raise ValueError(f"recall {k} plans by '{strategy}': give 1 or more, and one of {', '.join(RECALLS)}")
    count, spent = len(memory.plans), 0
    stored = memory.begins_with(view.problem.start[2])
    if stored and count > ASKED_FIRST and strategy in ("exhaustive", "hybrid"):
        early = among_the_first(memory, view, k)
        if early.free >= 0:
            return early
        spent = early.checks
    tried = {"mask": k, "hybrid": candidates, "exhaustive": count}.get(strategy, k)
    worth = count  # how many of these may be recalled
    if strategy == "random":
        order = pick_blindly(count, k, rng)
    elif strategy == "centroid":
        order = by_encoder(memory, view, k)
    elif not stored:
        order = by_encoder(memory, view, tried, never_none=True)
    else:
        narrowed = strategy == "hybrid" and candidates < count
        among = by_encoder(memory, view, candidates, never_none=True) if narrowed else None
        order, worth = by_cells(memory, view, among)
        order = order[: min(tried, worth) if strategy == "mask" else tried]
    view.lap("recall")
    free, checks = first_check(memory, view, order, stored)
    return Recalled(_with(free, order[: min(k, worth)].tolist(), k), free, spent + checks)


def among_the_first(memory: Memory, view: View, k: int) -> Recalled:
    """What the first plans of a large memory have for a problem of their heading, by blocked cells."""
    ranking = rank_by_cells(memory.masks[:ASKED_FIRST], view.bits, view.workspace)
    order = ranking.order[: min(TRIED_FIRST, int(ranking.places[WORTH_CELLS]))]
    view.lap("recall")
    free, checks = first_check(memory, view, order, stored=True)
    return Recalled(_with(free, order[:k].tolist(), k), free, checks)


def _with(free: int, head: list[int], k: int) -> tuple[int, ...]:
    """The first k plans, the free one among them."""
    return tuple(head if free < 0 or free in head else [free, *head][:k])


def pick_blindly(count: int, k: int, rng: np.random.Generator | None) -> Integers:
    """(At most) ``k`` of ``count`` plans."""
    if rng is None:
        raise ValueError("plans are picked blindly, but by no generator: pass an rng")
    return rng.choice(count, min(k, count), replace=False).astype(np.int32)


def by_encoder(memory: Memory, view: View, k: int, never_none: bool = False) -> Integers:
    """The (at most) ``k`` plans that score best, best first; none where "no plan" scores better."""
    bits = view.bits
    embedding = memory.forward(bits)
    view.lap("encode")
    if memory.lists is None:
        return best_plans(memory.vectors, memory.biases, embedding, k, never_none)
    best = best_listed(memory.lists, embedding, k)
    rows = np.concatenate(([0], best[:1] + 1))
    scores = memory.vectors[rows] @ embedding + memory.biases[rows]
    return best if never_none or scores[0] <= scores[-1] else best[:0]


def by_cells(memory: Memory, view: View, among: Integers | None = None) -> tuple[Integers, int]:
    """All plans, or those ``among``, the least blocked first, and how many of these are worth recalling."""
    masks = memory.masks if among is None else memory.masks[among]
    ranking = rank_by_cells(masks, view.bits, view.workspace)
    order = ranking.order if among is None else among[ranking.order]
    return order, int(ranking.places[WORTH_CELLS])


def first_check(memory: Memory, view: View, order: Integers, stored: bool) -> tuple[int, int]:
    """The first plan of ``order`` that answers the problem, -1 for none, and the collision checks to know.

    ``stored``: it begins with the heading of the stored plans; otherwise they are turned.
    """
    problem = view.problem
    found, checks = -1, 0
    if stored:
        found, checks = first_fitting_drawn(
            order[:TRIED_DRAWN], memory.sweeps, memory.masks, view.drawing, problem
        )
        order = order[TRIED_DRAWN:]
        view.lap("check")
    if found < 0 and len(order):
        found, more = first_fitting(order, memory.sweeps, ends_of(problem), view.scene)
        checks += more
        view.lap("check")
    return int(found), int(checks)


def rank(memory: Memory, grid: Grid) -> tuple[Integers, bool]:
    """All plans ``[N]`` in the encoder's order, best first, and whether "no plan" scores better than each."""
    embedding = memory.forward(bits_of(grid))
    order = best_plans(memory.vectors, memory.biases, embedding, len(memory.plans), never_none=True)
    return order, len(best_plans(memory.vectors, memory.biases, embedding, 1)) == 0
