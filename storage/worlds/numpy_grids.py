"""Maps and worlds as NumPy arrays: 0 free, 1 occupied, -1 or NaN unknown; row 0 at the top."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from planners.maps.occupancy_map import Cells, OccupancyMap
from planners.world.problem import Problem
from storage.worlds.limits import check_resolution, check_size
from storage.worlds.pictures import PIXELS, problem_of_cells

CELL_M: Final = 1.0
LONGEST_HEADER: Final = 10_000  # bytes, NumPy's own limit; few arrays need more than 128
MOST_NUMBERS: Final = 100_000_000  # in a stack of worlds: 2,475 of them
Array = np.ndarray[tuple[int, ...], np.dtype[Any]]


def is_stack(file: Path) -> bool:
    """Whether a ``file`` holds worlds ``[n, 201, 201]`` rather than a map ``[rows, columns]``."""
    return any(len(shape) == 3 for _, shape in _shapes(file))


def read_grid(
    file: Path, name: str, resolution: float | None = None, unknown_is_occupied: bool = True
) -> OccupancyMap:
    """The map called ``name`` in a ``file`` with one array ``[rows, columns]``, ``resolution`` metres a cell.

    Unknown cells are occupied or free. Raises ValueError, the end of a sentence, with what is wrong with the
    file.
    """
    metres = CELL_M if resolution is None else resolution
    check_resolution(metres)
    shapes = list(_shapes(file))
    if len(shapes) != 1 or len(shapes[0][1]) != 2:
        arrays = ", ".join(str(list(shape)) for _, shape in shapes[:5]) or "nothing"
        raise ValueError(f"holds {arrays}; expected one array [rows, columns]")
    check_size(*shapes[0][1])
    occupied, unknown = _judged(_arrays(file)[0][1])
    if not unknown_is_occupied:
        return OccupancyMap(name, occupied[::-1], metres)
    return OccupancyMap(name, (occupied | unknown)[::-1], metres, unknown=unknown[::-1])


def grid_worlds(
    file: Path, identity: str, class_name: str, unknown_is_occupied: bool = True
) -> Iterator[tuple[str, Problem | str]]:
    """The canonical problems of arrays ``[201, 201]`` or ``[n, 201, 201]``, and where each stands in them.

    Of a world that cannot be read it is said why.

    Args:
        file: the file of the arrays.
        identity: how the ids of the problems begin.
        class_name: their class.
        unknown_is_occupied: whether unknown cells are occupied, or free.

    Raises:
        ValueError: the end of a sentence, with what is wrong with the file.
    """
    shapes = list(_shapes(file))
    for name, shape in shapes:
        if shape[-2:] != (PIXELS, PIXELS) or len(shape) not in (2, 3):
            raise ValueError(f"holds {name} {list(shape)}; expected worlds [n, {PIXELS}, {PIXELS}]")
    if sum(int(np.prod(shape)) for _, shape in shapes) > MOST_NUMBERS:
        raise ValueError(f"holds more than {MOST_NUMBERS:,} numbers; cut it into several files")
    number = 0
    for name, array in _arrays(file):
        for index, cells in enumerate(array.reshape(-1, PIXELS, PIXELS)):
            where = f"{name}[{index}]"
            try:
                occupied, unknown = _judged(cells)
            except ValueError as error:
                yield where, str(error)
            else:
                blocked = occupied | unknown if unknown_is_occupied else occupied
                yield where, problem_of_cells(blocked, f"{identity}-{number}", class_name)
            number += 1


def _judged(cells: Array) -> tuple[Cells, Cells]:
    """Which cells are certainly occupied, and which are unknown."""
    unknown = np.isnan(cells) if cells.dtype.kind == "f" else np.zeros(cells.shape, bool)
    if cells.dtype.kind in "if":
        unknown = unknown | (cells == -1)
    occupied: Cells = cells == 1
    other = ~(unknown | occupied | (cells == 0))
    if other.any():
        raise ValueError(f"holds {cells[other][0]}; expected 0 (free), 1 (occupied) and -1 or NaN (unknown)")
    return occupied, unknown


def _shapes(file: Path) -> Iterator[tuple[str, tuple[int, ...]]]:
    """The names and shapes of the arrays in a file, from the headers alone."""
    try:
        if file.suffix == ".npz":
            with zipfile.ZipFile(file) as archive:
                for member in archive.infolist():
                    with archive.open(member) as stream:
                        yield member.filename.removesuffix(".npy"), _shape(stream)
        else:
            with file.open("rb") as stream:
                yield file.stem, _shape(stream)
    except FileNotFoundError:
        raise ValueError("does not exist; check the name") from None
    except Exception as error:  # NumPy raises whatever its parsers raise for a malformed header
        raise _broken(error) from None


def _shape(stream: IO[bytes]) -> tuple[int, ...]:
    is_first = np.lib.format.read_magic(stream) == (1, 0)
    size = stream.read(2 if is_first else 4)
    length = int.from_bytes(size, "little")
    if length > LONGEST_HEADER:  # NumPy would read it all before it refuses: gigabytes, if zeros were packed
        raise ValueError(f"its header claims {length:,} bytes, expected at most {LONGEST_HEADER:,}")
    read = np.lib.format.read_array_header_1_0 if is_first else np.lib.format.read_array_header_2_0
    shape, _, kind = read(io.BytesIO(size + stream.read(length)))
    if kind.kind not in "buif":
        raise ValueError(f"it holds {kind}, expected numbers or bool")
    return tuple(shape)


def _arrays(file: Path) -> list[tuple[str, Array]]:
    """The arrays of a file whose shapes were checked."""
    try:
        if file.suffix != ".npz":
            return [(file.stem, np.load(file, allow_pickle=False))]
        with np.load(file, allow_pickle=False) as archive:
            return [(name, archive[name]) for name in archive.files]
    except Exception as error:
        raise _broken(error) from None


def _broken(error: Exception) -> ValueError:
    reason = (str(error) or type(error).__name__).partition("\n")[0][:100]
    return ValueError(f"is not a complete NumPy file ({reason})")
