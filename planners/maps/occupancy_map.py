"""A map: which cells of a large grid are occupied, and where the grid lies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planners.world.arrays import Array, Floats, Pose

Cells = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """Occupied cells of a grid, and the grid's pose in the map's frame (metres, x to the right, y up).

    Grid coordinates are metres from the grid's lower left corner along its sides. Outside the grid everything
    is occupied.
    """

    name: str
    occupied: Cells  # [rows, columns]; row 0 is the lowest
    resolution: float  # metres a cell
    origin: Pose = (0.0, 0.0, 0.0)  # the lower left corner: x, y (m), turn (rad)
    unknown: Cells | None = None  # [rows, columns] the occupied cells that nobody has seen; for pictures only

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in metres."""
        rows, columns = self.occupied.shape
        return columns * self.resolution, rows * self.resolution

    def holds(self, x: float, y: float) -> bool:
        """Whether a point (m, m), in grid coordinates, lies on the grid."""
        width, height = self.size
        return 0.0 <= x <= width and 0.0 <= y <= height

    def is_free(self, points: Floats) -> Cells:
        """Whether each of ``points [n, 2]``, in grid coordinates, lies in a free cell."""
        columns, rows = np.floor(points / self.resolution).astype(np.int64).T
        height, width = self.occupied.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        free: Cells = inside.copy()
        free[inside] = ~self.occupied[rows[inside], columns[inside]]
        return free

    def pose(self, x: float, y: float, heading: float) -> Pose:
        """Transform a pose (m, m, rad) from grid coordinates into the map's frame."""
        left, bottom, turn = self.origin
        cos, sin = math.cos(turn), math.sin(turn)
        return left + cos * x - sin * y, bottom + sin * x + cos * y, heading + turn

    def grid_pose(self, x: float, y: float, heading: float) -> Pose:
        """Transform a pose (m, m, rad) from the map's frame into grid coordinates."""
        left, bottom, turn = self.origin
        cos, sin = math.cos(turn), math.sin(turn)
        right, up = x - left, y - bottom
        return cos * right + sin * up, cos * up - sin * right, heading - turn

    def coarser(self, cell_m: float) -> OccupancyMap:
        """Return the same map in cells of about ``cell_m`` metres, each occupied if any cell in it is."""
        factor = max(1, math.floor(cell_m / self.resolution + 1e-9))
        occupied: Cells = np.any(blocks(self.occupied, factor, True), axis=(1, 3))
        return OccupancyMap(self.name, occupied, factor * self.resolution, self.origin)


def blocks(cells: Array, factor: int, beyond: float) -> Array:
    """Group ``cells`` into squares of ``factor`` by ``factor``.

    Returns ``[rows, factor, columns, factor]``. Where a square reaches beyond the cells, it is ``beyond``.
    """
    rows, columns = cells.shape
    padded = np.pad(cells, ((0, -rows % factor), (0, -columns % factor)), constant_values=beyond)
    return padded.reshape(padded.shape[0] // factor, factor, padded.shape[1] // factor, factor)
