"""Maps and scenarios of the Moving AI benchmarks (Sturtevant 2012): characters as cells, row 0 at the top.

A cell is one metre unless another resolution is given. The lower left corner of the map is at (0, 0), y goes
up.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Floats
from storage.places.files import read_text
from storage.worlds.limits import check_file, check_resolution, check_size, whole_number

CELL_M: Final = 1.0
LARGEST_FILE: Final = 200_000_000  # bytes
PASSABLE: Final = ".GS"  # ground, and swamp
BLOCKED: Final = "@OTW"  # out of bounds, trees, and water
_ADVICE: Final = "cut it into several"
_HEADER: Final = ("type", "height", "width", "map")
_SCENARIO: Final = ("bucket", "map", "width", "height", "x", "y", "x", "y", "length")


def read_map(file: Path, name: str, resolution: float | None = None) -> OccupancyMap:
    """The map called ``name`` in a ``.map`` file, with cells of ``resolution`` metres.

    Raises ValueError, the end of a sentence, or StorageError with what is wrong with the file.
    """
    metres = CELL_M if resolution is None else resolution
    check_resolution(metres)
    check_file(file, LARGEST_FILE, _ADVICE)
    lines = read_text(file).splitlines()
    words = [line.split() for line in lines[:4]]
    if [word[0] if word else "" for word in words] != list(_HEADER):
        raise ValueError(f"does not begin with the lines {', '.join(_HEADER)}; is it a Moving AI map?")
    rows, columns = _count(words[1], "height"), _count(words[2], "width")
    check_size(rows, columns)
    cells = lines[4:]
    while cells and not cells[-1].strip():
        cells.pop()
    if len(cells) != rows or any(len(row) != columns for row in cells):
        wrong = next((i for i, row in enumerate(cells) if len(row) != columns), None)
        fault = (
            f"it has {len(cells)} rows" if wrong is None else f"row {wrong + 1} has {len(cells[wrong])} cells"
        )
        raise ValueError(f"should have {rows} rows of {columns} cells, but {fault}; is it cut off?")
    text = "".join(cells)
    odd = sorted(set(text) - set(PASSABLE + BLOCKED))
    if odd:
        raise ValueError(f"has the cell {odd[0]!r}; known are {PASSABLE + BLOCKED}")
    characters = np.frombuffer(text.encode("ascii"), np.uint8).reshape(rows, columns)
    free = np.isin(characters, np.frombuffer(PASSABLE.encode(), np.uint8))
    return OccupancyMap(name, ~free[::-1], metres)


def map_of_scenarios(file: Path) -> Path:
    """The ``.map`` file that a ``.scen`` file belongs to, beside it. Raises ValueError if there is none."""
    first = next(iter(_rows(file)), None)
    if first is None:
        raise ValueError("holds no scenario")
    name = first[1].replace("\\", "/").rpartition("/")[2]
    path = file.parent / name
    if not name.endswith(".map") or not path.is_file():
        raise ValueError(f"is for map {name[:60]!r}, which is not beside it; put it there")
    return path


def read_scenarios(file: Path, world: OccupancyMap) -> Floats:
    """Starts and ends ``[n, 2, 2]`` of the scenarios in a ``.scen`` file, grid metres, middles of cells.

    Args:
        file: the ``.scen`` file.
        world: the map they belong to.

    Raises:
        ValueError: a line is malformed, or of a map of another size.
    """
    rows, columns = world.occupied.shape
    ends = []
    for number, words in enumerate(_rows(file), start=1):
        try:
            width, height, *cells = (int(word) for word in words[2:8])
        except ValueError:
            raise ValueError(f"scenario {number} does not consist of {' '.join(_SCENARIO)}") from None
        if (width, height) != (columns, rows):
            raise ValueError(
                f"scenario {number} is for a map of {width} x {height} cells, but the map has "
                f"{columns} x {rows}"
            )
        if not all(0 <= cell < most for cell, most in zip(cells, (columns, rows) * 2, strict=True)):
            raise ValueError(f"scenario {number} begins or ends outside of the map")
        ends.append(cells)
    middles = np.array(ends, float).reshape(-1, 2, 2) + 0.5
    middles[..., 1] = rows - middles[..., 1]
    return world.resolution * middles


def _rows(file: Path) -> list[list[str]]:
    check_file(file, LARGEST_FILE, _ADVICE)
    lines = read_text(file).splitlines()
    if not lines or not lines[0].startswith("version"):
        raise ValueError("does not begin with a version; is it a scenario file?")
    rows = [line.split() for line in lines[1:] if line.strip()]
    for number, words in enumerate(rows, start=1):
        if len(words) != len(_SCENARIO):
            raise ValueError(f"scenario {number} has {len(words)} words, expected {' '.join(_SCENARIO)}")
    return rows


def _count(words: list[str], what: str) -> int:
    count = whole_number(words[1]) if len(words) == 2 else None
    if count is None:
        raise ValueError(f"has no whole number as its {what}; is it a Moving AI map?")
    return count
