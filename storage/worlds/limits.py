"""How large files and maps may be; those that ask for more are refused unread."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

MOST_CELLS: Final = 25_000_000  # 5,000 x 5,000: some seconds and a gigabyte while it is made into pieces
SMALLEST_CELL_M: Final = 0.001
LARGEST_CELL_M: Final = 100.0


def check_file(file: Path, most: int, advice: str) -> None:
    """Raise ValueError, the end of a sentence, if a ``file`` has more than ``most`` bytes.

    Args:
        file: the file.
        most: how many bytes it may have.
        advice: what to do if it has more.
    """
    if file.is_file() and file.stat().st_size > most:
        raise ValueError(f"is larger than {most:,} bytes; {advice}")


def whole_number(word: str) -> int | None:
    """The number that a ``word`` of up to seven digits writes; None if it is not one."""
    return int(word) if word.isascii() and word.isdigit() and len(word) < 8 else None


def check_size(rows: int, columns: int) -> None:
    """Raise ValueError, the end of a sentence, if ``rows`` by ``columns`` cells are none or too many."""
    if rows < 1 or columns < 1:
        raise ValueError(f"has {rows} x {columns} cells; expected at least one")
    if rows * columns > MOST_CELLS:
        raise ValueError(
            f"has {rows} x {columns} cells, more than {MOST_CELLS:,}; cut it up or make its cells larger"
        )


def check_resolution(metres: float) -> None:
    """Raise ValueError, the end of a sentence, if no map could have cells of so many ``metres``."""
    if not (math.isfinite(metres) and SMALLEST_CELL_M <= metres <= LARGEST_CELL_M):
        raise ValueError(
            f"has resolution {metres:g}; expected {SMALLEST_CELL_M:g} to {LARGEST_CELL_M:g} m for each cell"
        )
