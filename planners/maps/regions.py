"""Divides a map into blocks like a chequerboard: some to collect from, the others to test on."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np

from planners.maps.occupancy_map import Cells
from planners.world.arrays import Floats

Part = Literal["train", "test"]

BLOCK_WINDOWS: Final = 4.0  # side of a block in windows, so that half of the positions hold a whole window


class Blocks(NamedTuple):
    """Equal blocks of a map. Those at the border extend beyond it."""

    columns: int
    rows: int
    width: float  # metres
    height: float  # metres


def blocks_of(size: tuple[float, float], window_m: float) -> Blocks:
    """Divide a map of ``size`` metres into blocks for windows of ``window_m`` metres a side.

    Raises ValueError if the map is too small for two blocks.
    """
    columns, rows = (_count(extent, window_m) for extent in size)
    if columns * rows < 2:
        raise ValueError(
            f"is {size[0]:g} x {size[1]:g} m: too small to keep places to test on apart from places to "
            f"collect from; it takes {2 * window_m:g} m one way, so give a larger map, or a smaller scale if "
            "the vehicle has none of its own; or drive on this map and gather what `route --learn` keeps"
        )
    return Blocks(columns, rows, size[0] / columns, size[1] / rows)


def _count(extent: float, window_m: float) -> int:
    return max(round(extent / (BLOCK_WINDOWS * window_m)), 2 if extent >= 2.0 * window_m else 1)


def lie_in(part: Part, blocks: Blocks, low: Floats, high: Floats) -> Cells:
    """Whether each box from ``low [n, 2]`` to ``high [n, 2]`` (grid metres) lies in one block of a part."""
    side = np.array([blocks.width, blocks.height])
    most = np.array([blocks.columns, blocks.rows]) - 1
    first = np.clip(np.floor(low / side), 0, most)
    last = np.clip(np.floor(high / side), 0, most)
    whole: Cells = (first == last).all(axis=1) & (first.sum(axis=1) % 2 == (part == "test"))
    return whole
