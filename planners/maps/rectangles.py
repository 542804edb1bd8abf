"""Covers occupied cells exactly with the fewest rectangles that do not overlap.

A region of cells needs a cut at each of its reflex corners. A cut along a chord, which joins two of them,
saves one cut. The most chords that do not cross are a largest independent set of a bipartite graph (Lipski et
al. 1979, Ohtsuki 1982; the theorem of König). All other cuts go along the rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from planners.maps.occupancy_map import Cells
from planners.world.arrays import Indices


class Rectangles(NamedTuple):
    """Rectangles of cells: ``[n]`` the first row and column, and the row and column after the last."""

    first_rows: Indices
    last_rows: Indices
    first_columns: Indices
    last_columns: Indices


class _Chords(NamedTuple):
    """Lines of the lattice of cell corners, either all along its rows or all along its columns."""

    at: Indices  # [n] the row or column that they lie on
    first: Indices  # [n] where they begin along it
    last: Indices  # [n] where they end


def rectangles_of(occupied: Cells) -> Rectangles:
    """Return the fewest rectangles that cover exactly the occupied cells ``[rows, columns]``, each once."""
    padded = np.pad(occupied, ((0, 0), (1, 1)))
    border = padded[:, 1:] != padded[:, :-1]
    cut = _cuts(occupied)
    rows, begins = np.nonzero((border | cut) & padded[:, 1:])
    _, ends = np.nonzero((border | cut) & padded[:, :-1])
    order = np.lexsort((rows, ends, begins))  # a run joins the run above if both begin and end alike
    rows, begins, ends = rows[order], begins[order], ends[order]
    new = np.ones(len(rows), bool)
    new[1:] = (np.diff(begins) != 0) | (np.diff(ends) != 0) | (np.diff(rows) != 1)
    last = np.roll(new, -1)  # the run before a new rectangle ends one, and so does the last run
    return Rectangles(rows[new], rows[last] + 1, begins[new], ends[new])


def _cuts(occupied: Cells) -> Cells:
    """The cuts along columns ``[rows, columns + 1]``, between a cell and the one to its left."""
    padded = np.pad(occupied, 1).astype(np.int8)
    around = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
    reflex = around == 3  # [rows + 1, columns + 1] corners of the lattice
    upright = _chords(occupied, reflex)
    level = _chords(occupied.T, reflex.T)
    chosen = _uncrossed(upright, level, reflex.shape)
    cuts = np.zeros((occupied.shape[0], occupied.shape[1] + 1), bool)
    which, rows = _along(upright.first[chosen], upright.last[chosen])
    cuts[rows, upright.at[chosen][which]] = True
    return cuts


def _chords(occupied: Cells, reflex: Cells) -> _Chords:
    """Lines along columns between successive reflex corners, with occupied cells on both sides."""
    rows, columns = occupied.shape
    inside = np.zeros((rows + 1, columns + 1), np.int32)  # running sum of unit lines with cells on both sides
    inside[1:, 1:-1] = np.cumsum(occupied[:, 1:] & occupied[:, :-1], axis=0)
    at, along = np.nonzero(reflex.T)
    filled = inside[along[1:], at[1:]] - inside[along[:-1], at[:-1]]
    chord = (np.diff(at) == 0) & (filled == np.diff(along))
    return _Chords(at[:-1][chord], along[:-1][chord], along[1:][chord])


def _uncrossed(upright: _Chords, level: _Chords, shape: tuple[int, ...]) -> Cells:
    """Which upright chords ``[n]`` belong to a largest set of chords that have no point in common."""
    count, others = len(upright.at), len(level.at)
    if count == 0 or others == 0:
        return np.ones(count, bool)
    owner = np.full(shape, -1)
    which, rows = _along(upright.first, upright.last + 1)
    owner[rows, upright.at[which]] = which
    which, columns = _along(level.first, level.last + 1)
    met = owner[level.at[which], columns]
    crossing = sparse.csr_array(
        (np.ones(int((met >= 0).sum())), (which[met >= 0], met[met >= 0])), shape=(others, count)
    )
    partner = csgraph.maximum_bipartite_matching(crossing, perm_type="column")
    one, other = crossing.nonzero()
    matched = partner[one] == other
    alone = np.flatnonzero(partner < 0)
    source = count + others  # alternating paths begin here, go on to the level chords without a partner ...
    tails = np.concatenate([one[~matched], others + other[matched], np.full(len(alone), source)])
    heads = np.concatenate([others + other[~matched], one[matched], alone])
    paths = sparse.csr_array((np.ones(len(tails)), (tails, heads)), shape=(source + 1, source + 1))
    reached = csgraph.breadth_first_order(paths, source, return_predecessors=False)
    independent = np.ones(count, bool)  # ... and cover the upright chords that they reach (König)
    independent[reached[(reached >= others) & (reached < source)] - others] = False
    return independent


def _along(first: Indices, last: Indices) -> tuple[Indices, Indices]:
    """The integers from ``first [n]`` to before ``last [n]``, and for each the number of its range."""
    lengths = last - first
    which = np.repeat(np.arange(len(lengths)), lengths)
    starts = np.cumsum(lengths) - lengths
    return which, np.arange(len(which)) - starts[which] + first[which]
