"""Small maps as files of each format, all of the same cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from planners.maps.occupancy_map import Cells


def town_cells(seed: int = 0, rows: int = 150, columns: int = 200) -> Cells:
    """Blocks between streets; row 0 at the top."""
    rng = np.random.default_rng(seed)
    occupied = np.zeros((rows, columns), bool)
    for _ in range(rows * columns // 800):
        row, column = rng.integers(0, (rows, columns))
        height, width = rng.integers(2, 10, 2)
        occupied[row : row + height, column : column + width] = True
    return occupied


def write_map(file: Path, occupied: Cells) -> None:
    """A Moving AI map."""
    rows = ["".join("@" if cell else "." for cell in row) for row in occupied]
    height, width = occupied.shape
    file.write_text("\n".join(["type octile", f"height {height}", f"width {width}", "map", *rows]) + "\n")


def write_scenarios(file: Path, named: str, occupied: Cells, count: int = 5) -> None:
    """Scenarios of a map, from free cells to free cells; x is the column, y the row from the top."""
    height, width = occupied.shape
    ends = np.random.default_rng(1).choice(np.argwhere(~occupied), (count, 2))[..., ::-1].reshape(-1, 4)
    rows = [
        f"{i}\t{named}\t{width}\t{height}\t{a}\t{b}\t{c}\t{d}\t9.5" for i, (a, b, c, d) in enumerate(ends)
    ]
    file.write_text("\n".join(["version 1", *rows]) + "\n")


def write_ros(file: Path, occupied: Cells, image: str = "town.pgm", **fields: object) -> None:
    """A map_server pair: white free, black occupied."""
    Image.fromarray(np.where(occupied, 0, 254).astype(np.uint8)).save(file.parent / image)
    said = {
        "image": image,
        "resolution": 1.0,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    file.write_text(yaml.safe_dump(said | fields))


def write_scene(file: Path, polygons: list[list[list[float]]]) -> None:
    """A scene of polygons as text."""
    lines = [str(len(polygons))]
    for polygon in polygons:
        lines += [str(len(polygon)), " ".join(f"{x} {y}" for x, y in polygon), ""]
    file.write_text("\n".join(lines))
