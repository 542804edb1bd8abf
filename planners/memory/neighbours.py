"""An index over the readout's rows: the plans that score best for an embedding, without scoring them all.

A graph of approximate neighbours (HNSW: Malkov and Yashunin 2018), by usearch. It knows distances, recall
wants the largest ``w . e + b``. So rows are lengthened to a common length R, to ``(w, b, s)`` with
``s^2 = R^2 - |w|^2 - b^2``: their squared distance to ``(e, 1, 0)`` is ``R^2 + |e|^2 + 1 - 2 (w . e + b)``
(Bachrach et al. 2014).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from planners.memory.encoder import Floats32
from planners.world.problem import Integers

if TYPE_CHECKING:
    from usearch.index import Index

FROM_PLANS: Final = 20_000  # with fewer, scoring them all is as fast
CONNECTIVITY: Final = 16  # neighbours of a row in the graph; 32 find no more, in a larger file
EXPANSION_ADD: Final = 128  # rows looked at to place one; with 64 a fifth of the first 16 is missed
EXPANSION_SEARCH: Final = 64  # rows looked at to find some, at least; and at least twice those wanted


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The index of N plans, as usearch writes it: used where it lies, not copied.

    Raises ValueError where the contents are no such index.
    """

    contents: memoryview
    plans: int  # N
    dimensions: int  # D of the embedding
    _index: Index = field(init=False, repr=False)

    def __post_init__(self) -> None:
        from usearch.index import Index

        try:
            index = Index.restore(self.contents, view=True)
        except RuntimeError as error:  # what usearch raises for a file that ends too soon
            raise ValueError(f"the index cannot be read: {error}") from None
        if index is None or (len(index), index.ndim) != (self.plans, self.dimensions + 2):
            raise ValueError(f"the index is not of {self.plans} plans, {self.dimensions} numbers each")
        object.__setattr__(self, "_index", index)

    def best(self, embedding: Floats32, k: int) -> Integers:
        """(Nearly) the ``k`` plans that score best for an embedding ``[D]``, best first."""
        query = np.zeros(self.dimensions + 2, np.float32)
        query[:-2] = embedding
        query[-2] = 1.0
        self._index.expansion_search = max(EXPANSION_SEARCH, 2 * k)  # type: ignore[misc]  # it has a setter
        return self._index.search(query, min(k, self.plans), threads=1).keys.astype(np.int32)


def index_readout(vectors: Floats32, biases: Floats32) -> Neighbours:
    """Index a readout, ``vectors [N + 1, D]`` and ``biases [N + 1]``; the same gives the same bytes."""
    from usearch.index import Index

    rows = np.column_stack((vectors[1:], biases[1:])).astype(np.float64)
    squares = np.square(rows).sum(1)
    lengthened = np.column_stack((rows, np.sqrt(squares.max() - squares))).astype(np.float32)
    index = Index(
        ndim=lengthened.shape[1],
        metric="l2sq",
        dtype="f32",
        connectivity=CONNECTIVITY,
        expansion_add=EXPANSION_ADD,
        expansion_search=EXPANSION_SEARCH,
    )
    index.add(np.arange(len(rows)), np.ascontiguousarray(lengthened), threads=1)  # with more, bytes differ
    contents = index.save()
    assert contents is not None  # no path was given
    return Neighbours(memoryview(contents), len(rows), vectors.shape[1])
