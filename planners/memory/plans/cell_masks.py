"""The cells that a plan sweeps, one bit each. Counting bits ranks plans, and may prove that a plan is free.

A cell is set if a swept box of the plan meets it, as a cell of the occupancy grid is set if an obstacle meets
it. If the two share no cell, the plan is free without a check.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.memory.plans.sweeps import PlanSweeps
from planners.world.arrays import Floats, Floats32, Integers
from planners.world.geometry.occupancy import ALL_CELLS, CANONICAL_WINDOW, GRID, Bits, draw_piece
from planners.world.jit import inlined, jit, lean
from planners.world.problem import BOUNDS
from planners.world.workspace import Workspace

ROUNDING_M = 1e-6  # boxes are drawn larger by this, so that rounding never loses a cell
MOST_CELLS = 511  # a plan sweeps some 200; with more blocked cells plans count as equally blocked
POSSIBLE_FOR_EACH_LIKELY = 3  # plans to check in all for each that is likely to be free
PROVEN = 10.0  # score of a plan without a blocked cell: it is free, whatever an encoder says
_PAIRS = np.uint64(0x5555555555555555)
_NIBBLES = np.uint64(0x3333333333333333)
_BYTES = np.uint64(0x0F0F0F0F0F0F0F0F)
_LOW = np.uint64(0x0101010101010101)


@lean
def _draw_sweeps(sweeps: PlanSweeps, corners: Floats, words: Bits, spans: Floats, masks: Bits) -> None:
    boxes = sweeps.boxes
    for i in range(masks.shape[0]):
        for row in range(GRID):
            masks[i, row] = np.uint64(0)
        inside = True
        for j in range(sweeps.starts[i], sweeps.starts[i + 1]):
            half_length = boxes[j, 4] + ROUNDING_M
            half_width = boxes[j, 5] + ROUNDING_M
            for k in range(4):
                u = half_length if k == 1 or k == 2 else -half_length
                w = half_width if k >= 2 else -half_width
                x = boxes[j, 0] + u * boxes[j, 2] - w * boxes[j, 3]
                y = boxes[j, 1] + u * boxes[j, 3] + w * boxes[j, 2]
                inside &= BOUNDS[0] < x < BOUNDS[2] and BOUNDS[1] < y < BOUNDS[3]
                corners[k, 0] = x
                corners[k, 1] = y
            row_0, row_1 = draw_piece(corners, 0, 4, words, spans, CANONICAL_WINDOW)
            for row in range(row_0, row_1 + 1):
                masks[i, row] |= words[row]
        if not inside:
            for row in range(GRID):
                masks[i, row] = ALL_CELLS


def masks_of(sweeps: PlanSweeps) -> Bits:
    """Draw the swept cells ``[N, 64]`` of N plans as bits (``planners.world.geometry.occupancy``).

    A plan that leaves the window of the grid gets all cells set, so that they prove nothing about it.
    """
    masks = np.empty((len(sweeps.starts) - 1, GRID), np.uint64)
    _draw_sweeps(sweeps, np.empty((4, 2)), np.empty(GRID, np.uint64), np.empty((2, GRID)), masks)
    return masks


@inlined
def count_bits(word: np.uint64) -> np.uint64:
    """Count the bits that are set. LLVM knows this idiom and counts the bits of eight words at a time."""
    one = np.uint64(1)
    word = word - ((word >> one) & _PAIRS)
    word = (word & _NIBBLES) + ((word >> np.uint64(2)) & _NIBBLES)
    word = (word + (word >> np.uint64(4))) & _BYTES
    return np.uint64((word * _LOW) >> np.uint64(56))


@inlined
def blocked_cells(masks: Bits, i: int, occupied: Bits) -> int:
    """Count the cells of plan ``i`` that are not free, at most MOST_CELLS: also if it leaves the window."""
    if masks[i, 0] == ALL_CELLS:
        return MOST_CELLS
    count = np.uint64(0)
    for row in range(GRID):
        count += count_bits(masks[i, row] & occupied[row])
    return min(int(np.int64(count)), MOST_CELLS)  # with an unsigned number Numba would make floats


@lean
def count_blocked_cells(masks: Bits, occupied: Bits, counts: Integers) -> None:
    """Count the blocked cells ``counts [n, N]`` of N plans in n problems.

    ``masks [N, 64]``: the cells that each plan sweeps; ``occupied [n, 64]``: those that are not free.
    """
    for problem in range(occupied.shape[0]):
        for i in range(masks.shape[0]):
            counts[problem, i] = blocked_cells(masks, i, occupied[problem])


class Ranking(NamedTuple):
    """N plans by the number of their swept cells that are not free."""

    cells: Integers  # [N] blocked cells of each plan, at most MOST_CELLS
    order: Integers  # [N] the plans, the least blocked first; equal ones in the order of the memory
    ends: Integers  # [MOST_CELLS + 2] how many plans have at most so many blocked cells


def allocate_ranking(count: int) -> Ranking:
    """Buffers for ``count`` plans."""
    return Ranking(np.empty(count, np.int32), np.empty(count, np.int32), np.empty(MOST_CELLS + 2, np.int32))


def allocate_tries(count: int) -> Integers:
    """A buffer for the numbers of at most ``count`` plans."""
    return np.empty(count, np.int32)


@lean
def _rank(masks: Bits, occupied: Bits, ranking: Ranking) -> None:
    cells = ranking.cells
    ends = ranking.ends
    ends.fill(0)
    for i in range(masks.shape[0]):
        blocked = blocked_cells(masks, i, occupied)
        cells[i] = blocked
        ends[blocked + 1] += 1
    for blocked in range(MOST_CELLS + 1):
        ends[blocked + 1] += ends[blocked]
    for i in range(masks.shape[0]):
        blocked = cells[i]
        ranking.order[ends[blocked]] = i
        ends[blocked] += 1


def rank_by_cells(masks: Bits, occupied: Bits, workspace: Workspace | None = None) -> Ranking:
    """Rank N plans by how many of their swept cells are not free.

    Args:
        masks: ``[N, 64]`` the cells that each plan sweeps.
        occupied: ``[64]`` the cells that are not free.
        workspace: the caller's buffers, which the next ranking of N plans overwrites; by default new ones.
    """
    ranking = (workspace or Workspace()).buffers(allocate_ranking, len(masks))
    _rank(masks, occupied, ranking)
    return ranking


@lean
def _rank_to_try(
    masks: Bits,
    occupied: Bits,
    by_cost: Integers,
    likely: int,
    possible: int,
    ranking: Ranking,
    tries: Integers,
) -> int:
    _rank(masks, occupied, ranking)
    few = ranking.ends[likely]
    most = min(ranking.ends[possible], POSSIBLE_FOR_EACH_LIKELY * few)
    filled = 0
    for i in by_cost:
        if ranking.cells[i] <= likely:
            tries[filled] = i
            filled += 1
    for filled in range(few, most):
        tries[filled] = ranking.order[filled]
    return int(most)


def rank_to_try(
    masks: Bits, occupied: Bits, by_cost: Integers, likely: int, possible: int, workspace: Workspace
) -> tuple[Ranking, Integers]:
    """Rank N plans by how many of their swept cells are not free, and choose which to check, in what order.

    Plans with at most ``likely`` blocked cells come first, the cheapest to drive first. Then come some of
    those with at most ``possible``, the least blocked first: few where few are likely to be free, because
    then the memory is one of other problems.

    Args:
        masks: ``[N, 64]`` the cells that each plan sweeps.
        occupied: ``[64]`` the cells that are not free.
        by_cost: ``[N]`` the plans, the cheapest to drive first.
        likely: blocked cells.
        possible: blocked cells.
        workspace: the caller's buffers, which the next ranking of N plans overwrites.

    Returns:
        The ranking, and the plans to check ``[n]``.
    """
    ranking = workspace.buffers(allocate_ranking, len(masks))
    tries = workspace.buffers(allocate_tries, len(masks))
    count = _rank_to_try(masks, occupied, by_cost, likely, possible, ranking, tries)
    return ranking, tries[:count]


def _cell_scores() -> Floats32:
    """What 0, 1, ... blocked cells tell of a plan, ``[MOST_CELLS + 1]``, as logits.

    Learned beside the encoder, on classes at ``hard`` and on cities, these were 0.2 to 0.5 a cell and 0.5 to
    1.1 a logarithm. Which of them makes no difference, since the encoder learns the rest.
    """
    cells = np.arange(MOST_CELLS + 1)
    scores = -0.3 * cells - 0.9 * np.log1p(cells)
    scores[0] = PROVEN
    return scores.astype(np.float32)


CELL_SCORES = _cell_scores()


@jit
def least_blocked(
    order: Integers, masks: Bits, occupied: Bits, first_poses: Floats, x: float, y: float, tolerance: float
) -> tuple[int, int]:
    """Find the plan of ``order [k]`` that shares the fewest cells with obstacles, and how many these are.

    Only plans that begin at (x, y) count, to a ``tolerance`` in metres; it is -1 if there is none, and the
    first of equals. ``masks [N, 64]``: the cells that each plan sweeps; ``occupied [64]``: those that are not
    free; ``first_poses [N, 3]``: where the plans begin.
    """
    best = -1
    fewest = 0
    for i in order:
        if abs(first_poses[i, 0] - x) > tolerance or abs(first_poses[i, 1] - y) > tolerance:
            continue
        cells = blocked_cells(masks, i, occupied)
        if best < 0 or cells < fewest:
            best = i
            fewest = cells
    return best, fewest
