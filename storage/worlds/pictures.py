"""Worlds as PNG pictures of 201 x 201 pixels (motion_planning_datasets), dark where an obstacle is."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from scipy import ndimage

from planners.maps.occupancy_map import Cells
from planners.maps.rectangles import rectangles_of
from planners.world.problem import (
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    Obstacles,
    Problem,
    obstacles_of,
)
from storage.worlds.picture_files import read_picture

PIXELS: Final = 201  # a side
PIXEL_M: Final = 0.3
CORNER_M: Final = -5.0  # x and y of the lower left corner, so that start and goal lie inside
DARK: Final = 128  # grey levels below are obstacles


def picture_world(file: Path, identity: str, class_name: str) -> Problem:
    """The canonical problem that the picture in a ``file`` shows, with an id ``identity`` and a class.

    Raises ValueError, the end of a sentence, with what is wrong with the file.
    """
    levels = read_picture(file, ("PNG",), (PIXELS, PIXELS)).levels
    return problem_of_cells(levels < DARK, identity, class_name)


def problem_of_cells(occupied: Cells, identity: str, class_name: str) -> Problem:
    """The canonical problem with pixels ``occupied [201, 201]``, row 0 at the top, an id and a class."""
    low, high = np.round(CORNER_M + PIXEL_M * np.array([0, PIXELS]), 6).tolist()
    bounds = (low, low, high, high)
    obstacles = obstacles_of_cells(occupied)
    return Problem(identity, class_name, CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, bounds, obstacles)


def obstacles_of_cells(occupied: Cells) -> Obstacles:
    """The fewest rectangles that cover exactly the ``occupied [rows, columns]`` pixels, row 0 at the top.

    An obstacle holds the rectangles of a region whose pixels share sides.
    """
    upright = occupied[::-1]
    fewest = rectangles_of(upright)
    regions, count = ndimage.label(upright)
    region = regions[fewest.first_rows, fewest.first_columns]
    edges = np.stack([fewest.first_columns, fewest.first_rows, fewest.last_columns, fewest.last_rows], axis=1)
    boxes = np.round(CORNER_M + PIXEL_M * edges, 6)
    corners = boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]
    order = np.argsort(region, kind="stable")
    groups = np.split(corners[order], np.searchsorted(region[order], np.arange(2, count + 1)))
    return obstacles_of([list(group) for group in groups if len(group)])
