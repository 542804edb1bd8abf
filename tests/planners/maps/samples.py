"""Maps for tests: a town of blocks between streets."""

from __future__ import annotations

import numpy as np

from planners.maps.occupancy_map import OccupancyMap


def town(
    seed: int = 0,
    size: int = 300,
    resolution: float = 1.0,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> OccupancyMap:
    """``size`` cells a side with boxes, a slanted wall and a few trees."""
    rng = np.random.default_rng(seed)
    occupied = np.zeros((size, size), bool)
    for _ in range(size * size // 1000):
        row, column = rng.integers(0, size, 2)
        height, width = rng.integers(1, 12, 2)
        occupied[row : row + height, column : column + width] = True
    for i in range(size // 4):
        occupied[size // 3 + i, size // 5 + 2 * i : size // 5 + 2 * i + 4] = True
    return OccupancyMap(f"town-{seed}", occupied, resolution, origin)
