"""How large a map may be, in cells and in metres; files that ask for more are refused unread."""

from __future__ import annotations

import math
from typing import Final

MOST_CELLS: Final = 25_000_000  # 5,000 x 5,000: some seconds and a gigabyte while it is made into pieces
SMALLEST_CELL_M: Final = 0.001
LARGEST_CELL_M: Final = 100.0
LARGEST_FILE: Final = 200_000_000  # bytes


def check_size(rows: int, columns: int) -> None:
    """ValueError, the end of a sentence, where a grid is empty or too large."""
    if rows < 1 or columns < 1:
        raise ValueError(f"has {rows} x {columns} cells; wanted is at least one")
    if rows * columns > MOST_CELLS:
        raise ValueError(
            f"has {rows} x {columns} cells, more than {MOST_CELLS:,}; cut it up or make its cells larger"
        )


def check_resolution(metres: float) -> None:
    """ValueError, the end of a sentence, where a cell's side is no length that a map could have."""
    if not (math.isfinite(metres) and SMALLEST_CELL_M <= metres <= LARGEST_CELL_M):
        raise ValueError(
            f"has resolution {metres:g}; wanted are metres a cell, {SMALLEST_CELL_M:g} to {LARGEST_CELL_M:g}"
        )
