"""Recall: which stored plans to try on a problem, by one of six strategies (paper, III-C is ``centroid``).

| strategy | who ranks | which plans are checked exactly |
|---|---|---|
| encoder | the readout that the encoder was trained with, and blocked cells | the first k |
| centroid | the distance of the embedding to each plan's centroid | the first k |
| mask | blocked cells | the first k |
| hybrid | the encoder picks some hundred, blocked cells rank these | those of these that may be free |
| exhaustive | blocked cells | all that may be free |
| random | nobody | k picked blindly |

By cells, the plans that are likely to be free are tried, the cheapest first, and then some that may be free.
To check all others in vain would cost a planner that is soon done more than the few that are free would save.
So where more than three quarters of the plans seem free, that many, the least blocked, are looked at first:
if none of these is free, no other is tried.

In a large memory ``hybrid`` and ``exhaustive`` try the first thousand plans before the others. If any plan is
free, one of these mostly is, so the time to find it does not grow with the memory.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import rank_by_cells, rank_to_try
from planners.memory.plans.free import NO_PLANS, ends_of, first_fitting, first_fitting_drawn
from planners.memory.ranking.inverted_lists import best_listed
from planners.memory.ranking.scores import best_plans
from planners.world.arrays import Floats32, Integers
from planners.world.geometry.occupancy import Bits, Grid, bits_of
from planners.world.view import View
from planners.world.workspace import Workspace

STRATEGIES: Final = ("encoder", "centroid", "exhaustive", "mask", "hybrid", "random")
CANDIDATES: Final = 256  # plans that the encoder picks of a large memory
MOST_SCORED: Final = 1_000  # plans: with more, scoring by cells costs more than the encoder
MOST_EXHAUSTIVE: Final = 10_000  # plans: with more, ranking by cells costs more than the encoder
TRIED_EARLY: Final = 1_000  # plans of a large memory that are ranked first
CHECKED_EARLY: Final = 64  # of these, the best ranked: if they are blocked, the others mostly are, too
WORTH_CELLS: Final = 40  # blocked cells: in no class was a plan with 30 or more free
LIKELY_CELLS: Final = 16  # blocked cells: where a plan with more is free, one with fewer mostly is, too
POSSIBLE_CELLS: Final = 24  # blocked cells: on curves at hard only such plans are free in 9 % of problems
DECISIVE: Final = 72  # the least blocked, and at least three quarters: if none is free, no other is tried


class Recalled(NamedTuple):
    """What a memory has for a problem."""

    plans: tuple[int, ...]  # at most k, best first
    free: int  # one of these that fits the problem; -1 if none of those that were checked does
    checks: int  # collision checks that this took


def default_recall(memory: Memory) -> str:
    """Return the strategy that measures best for the size of a memory (docs/method.md)."""
    return "exhaustive" if len(memory.plans) <= MOST_EXHAUSTIVE else "hybrid"


def recall(
    memory: Memory,
    view: View,
    strategy: str,
    k: int,
    rng: np.random.Generator | None = None,
    candidates: int = CANDIDATES,
) -> Recalled:
    """Recall the best plans for a problem, and the first of them that fits it.

    There are fewer than k, or none, if the strategy holds that no plan fits: ``encoder`` if "no plan" scores
    best, ``centroid`` if the centroid of the problems without a plan is nearest. The others leave out plans
    with more blocked cells than ``WORTH_CELLS``. Cells hold only for plans as they are stored, so for a
    problem of another start heading the encoder ranks instead.

    Args:
        memory: to recall from.
        view: the problem.
        strategy: one of ``STRATEGIES``.
        k: how many plans to return at most.
        rng: the source of the choices of ``random``.
        candidates: how many plans the encoder picks for ``hybrid``.

    Raises:
        ValueError: The strategy is unknown, k is below 1, or ``random`` has no ``rng``.
    """
    if strategy not in STRATEGIES or k < 1:
        raise ValueError(
            f"recall {k} plans by '{strategy}': give 1 or more, and one of {', '.join(STRATEGIES)}"
        )
    count, spent = len(memory.plans), 0
    as_stored = memory.begins_with(view.problem.start[2])
    if as_stored and count > TRIED_EARLY and strategy in ("exhaustive", "hybrid"):
        early = among_the_first(memory, view, k)
        if early.free >= 0:
            return early
        spent = early.checks
    worth = likely = (
        count  # how many of the ranked plans may be returned, and how many are tried by their costs
    )
    tries: Integers | None = None
    decisive = NO_PLANS
    if strategy == "random":
        order = pick_blindly(count, k, rng)
    elif strategy == "encoder":
        order = by_encoder(memory, view, k)
    elif strategy == "centroid":
        order, likely = by_centroids(memory, view, k), 0  # the nearest free one is the answer, as published
    elif not as_stored:
        most = {"mask": k, "hybrid": candidates, "exhaustive": count}[strategy]
        order, likely = by_encoder(memory, view, most, never_none=True), max(k, CHECKED_EARLY)
    else:
        narrowed = strategy == "hybrid" and candidates < count
        among = by_encoder(memory, view, candidates, never_none=True) if narrowed else None
        order, ends, tries = by_cells(memory, view, among)
        worth = int(ends[WORTH_CELLS])
        if strategy == "mask":
            order, tries = order[: min(k, worth)], None
        elif len(tries) > (told := max(DECISIVE, 3 * len(order) // 4)):
            decisive = order[:told]
    if tries is None:
        tries = cheapest_first(memory, order, likely)
    view.lap("recall")
    free, checks = first_check(memory, view, tries, as_stored, decisive)
    return Recalled(_with(free, order[: min(k, worth)].tolist(), k), free, spent + checks)


def among_the_first(memory: Memory, view: View, k: int) -> Recalled:
    """Recall from the first plans of a large memory, by blocked cells, for a problem of their heading."""
    ranking = rank_by_cells(memory.masks[:TRIED_EARLY], view.bits, view.workspace)
    order = ranking.order[: min(CHECKED_EARLY, int(ranking.ends[WORTH_CELLS]))]
    tries = cheapest_first(memory, order[: int(ranking.ends[LIKELY_CELLS])], len(order))
    view.lap("recall")
    free, checks = first_check(memory, view, tries, as_stored=True)
    return Recalled(_with(free, order[:k].tolist(), k), free, checks)


def cheapest_first(memory: Memory, order: Integers, likely: int) -> Integers:
    """Order the first ``likely`` plans of ``order [n]`` by what it costs to drive them, the cheapest first.

    The others follow as they stand, the least blocked first.
    """
    head = order[:likely]
    return np.concatenate((head[np.argsort(memory.costs[head], kind="stable")], order[likely:]))


def _with(free: int, head: list[int], k: int) -> tuple[int, ...]:
    """The first k plans, with the free one among them."""
    return tuple(head if free < 0 or free in head else [free, *head][:k])


def pick_blindly(count: int, k: int, rng: np.random.Generator | None) -> Integers:
    """Pick (at most) ``k`` of ``count`` plans. Raises ValueError if there is no generator."""
    if rng is None:
        raise ValueError("plans are picked blindly, but by no generator: pass an rng")
    return rng.choice(count, min(k, count), replace=False).astype(np.int32)


def by_encoder(memory: Memory, view: View, k: int, never_none: bool = False) -> Integers:
    """Rank the (at most) ``k`` plans that score best, best first.

    If "no plan" scores better than all of them there are none, unless ``never_none``.
    """
    embedding = memory.forward(view.bits)
    view.lap("encode")
    among, scores = scored(memory, embedding, view.bits, k, view.workspace)
    return among[best_plans(scores, k, never_none)]


def scored(
    memory: Memory, embedding: Floats32, bits: Bits, k: int, workspace: Workspace | None = None
) -> tuple[Integers, Floats32]:
    """Score all plans, or of a large memory those ``CANDIDATES``, at least k, that the readout finds.

    Args:
        memory: of the plans.
        embedding: ``[D]`` of the problem.
        bits: ``[64]`` the cells of the problem that are not free.
        k: how many plans are wanted.
        workspace: the caller's buffers; by default new ones.

    Returns:
        The plans ``[n]``, and scores ``[n + 1]`` of "no plan" and of these.
    """
    if len(memory.plans) <= MOST_SCORED:
        return np.arange(len(memory.plans), dtype=np.int32), memory.scores(embedding, bits, workspace)
    among = by_readout(memory, embedding, max(k, CANDIDATES))
    return among, memory.scores(embedding, bits, workspace, among)


def by_readout(memory: Memory, embedding: Floats32, k: int) -> Integers:
    """Find the ``k`` plans that score best for an embedding ``[D]`` by the readout alone, best first."""
    if memory.lists is not None:
        return best_listed(memory.lists, embedding, k)
    return best_plans(memory.vectors @ embedding + memory.biases, k, never_none=True)


def by_centroids(memory: Memory, view: View, k: int) -> Integers:
    """Rank the (at most) ``k`` plans whose centroids are nearest to the problem's embedding, nearest first.

    If the centroid of the problems that no plan solves is nearer than all of them there are none.
    """
    embedding = memory.forward(view.bits)
    view.lap("encode")
    vectors, biases = memory.nearest
    return best_plans(vectors @ embedding + biases, k)


def by_cells(
    memory: Memory, view: View, among: Integers | None = None
) -> tuple[Integers, Integers, Integers]:
    """Rank all plans, or those ``among [n]``, the least blocked first.

    Returns the plans in this order, how many of them have at most 0, 1, ... blocked cells, and which of them
    to check, in order.
    """
    if among is None:
        masks, by_cost = memory.masks, memory.by_cost
    else:
        masks = memory.masks[among]
        by_cost = np.argsort(memory.costs[among], kind="stable").astype(np.int32)
    ranking, tries = rank_to_try(masks, view.bits, by_cost, LIKELY_CELLS, POSSIBLE_CELLS, view.workspace)
    if among is None:
        return ranking.order, ranking.ends, tries
    return among[ranking.order], ranking.ends, among[tries]


def first_check(
    memory: Memory, view: View, order: Integers, as_stored: bool, decisive: Integers = NO_PLANS
) -> tuple[int, int]:
    """Find the first plan of ``order [n]`` that fits the problem (-1: none), and count the collision checks.

    ``as_stored`` says that the problem begins with the heading of the stored plans. These are then checked
    from the drawing, ``decisive`` first; else plans are turned, and checked in the scene.
    """
    if not len(order):
        return -1, 0
    if as_stored:
        asked = (order, memory.sweeps, memory.masks, view.drawing, view.problem, decisive)
        plan, checks = first_fitting_drawn(*asked)
    else:
        plan, checks = first_fitting(order, memory.sweeps, ends_of(view.problem), view.scene)
    view.lap("check")
    return int(plan), int(checks)


def rank(memory: Memory, grid: Grid) -> tuple[Integers, bool]:
    """Rank plans by the encoder, best first, and tell whether "no plan" scores better than each.

    ``grid [64, 64]`` is the problem's occupancy. All plans ``[N]`` are ranked, or the candidates of a large
    memory.
    """
    bits = bits_of(grid)
    among, scores = scored(memory, memory.forward(bits), bits, 1)
    order = among[best_plans(scores, len(among), never_none=True)]
    return order, len(best_plans(scores, 1)) == 0
