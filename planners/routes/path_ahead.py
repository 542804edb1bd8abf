"""Where a vehicle should go next: places on the shortest path over a map, and the way to the goal."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths
from planners.world.arrays import Flags, Floats, Point
from planners.world.problem import CANONICAL_DISTANCE, GOAL_RADIUS

REACHES_M: Final = (60.0, 35.0, 20.0, 10.0)  # along the path to the local goals, in the order of trial
SOUGHT_M: Final = 10.0  # before the end of a reach: so far back a place with more room is looked for
TIGHT_M: Final = 3.0  # of the path, given up for each metre of clearance that a place lacks


class LocalGoal(NamedTuple):
    """Where a leg should lead."""

    place: Point  # metres
    final: bool  # it is the route's goal
    at_rest: bool  # the plan itself has to end there at rest


class PathAhead:
    """The shortest paths over a map's cells to one goal, from anywhere. Lengths are canonical metres."""

    def __init__(self, paths: GlobalPaths, goal: Point) -> None:
        self.goal = goal
        self._paths = paths.paths_to(_free_point(paths, goal))
        self._cell_m = paths.grid.resolution
        free = ~paths.grid.occupied
        self._to_go = np.pad(self._paths.metres, 1, constant_values=math.inf)
        self._room = self._cell_m * np.pad(ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1], 1)
        # a vehicle may stand free in a cell that is not free: then the path begins beside it
        self._from_here = ndimage.minimum_filter(self._to_go, 3)

    def to_go(self, poses: Floats) -> Floats:
        """Return the metres ``[n]`` of shortest paths from ``poses [n, >= 2]``; infinite: no path."""
        metres: Floats = self._at(self._from_here, poses[:, 0], poses[:, 1])
        return metres

    def path(self, pose: Floats) -> Floats | None:
        """Return the shortest path ``[n, 2]`` over the cells from a pose ``[>= 2]``, or None."""
        column, row = np.floor(pose[:2] / self._cell_m).astype(int)
        around = [(column + right, row + up) for up in (0, 1, -1) for right in (0, 1, -1)]
        centres = self._cell_m * (np.array(around) + 0.5)
        to_go = self._at(self._to_go, centres[:, 0], centres[:, 1])
        best = int(to_go.argmin()) if to_go[0] == math.inf else 0
        return None if to_go[best] == math.inf else self._paths.path(centres[best])

    def distance(self, poses: Floats) -> Floats:
        """Return the metres ``[n]`` from ``poses [n, >= 2]`` to the goal's centre."""
        metres: Floats = np.hypot(poses[:, 0] - self.goal[0], poses[:, 1] - self.goal[1])
        return metres

    def arrived(self, poses: Floats) -> Flags:
        """Whether each of ``poses [n, >= 2]`` lies in the goal disc."""
        near: Flags = self.distance(poses) <= GOAL_RADIUS
        return near

    def local_goals(self, pose: Floats) -> list[LocalGoal]:
        """Return local goals ahead of a pose ``[>= 2]``, in the order of trial.

        They lie on the shortest path, none farther than canonical goals. Where the path ends within the
        reach, the goal itself is the first.
        """
        path = self.path(pose)
        if path is None:
            return []
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        straight = np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1])
        lacking = np.maximum(GOAL_RADIUS - self._at(self._room, path[:, 0], path[:, 1]), 0.0)
        goals: list[LocalGoal] = []
        if along[-1] <= REACHES_M[0] and math.dist(pose[:2], self.goal) <= CANONICAL_DISTANCE:
            goals += [LocalGoal(self.goal, True, False), LocalGoal(self.goal, True, True)]
        for reach in REACHES_M:
            within = (along <= reach) & (along >= reach - SOUGHT_M) & (straight <= CANONICAL_DISTANCE)
            if reach < along[-1] and within.any():
                x, y = path[int(np.where(within, along - TIGHT_M * lacking, -math.inf).argmax())].tolist()
                goals.append(LocalGoal((x, y), False, False))
        return goals

    def _at(self, values: Floats, x: Floats, y: Floats) -> Floats:
        """The value of the cell of each point, of ``values [rows + 2, columns + 2]`` with a border of one."""
        rows, columns = np.array(values.shape) - 1
        row = np.clip(np.floor(y / self._cell_m) + 1, 0, rows).astype(np.int64)
        column = np.clip(np.floor(x / self._cell_m) + 1, 0, columns).astype(np.int64)
        of_cells: Floats = values[row, column]
        return of_cells


def _free_point(paths: GlobalPaths, goal: Point) -> Floats:
    """The centre of the free cell nearest to the goal, if it lies in the goal disc; else the goal."""
    grid = paths.grid
    rows, columns = np.nonzero(~grid.occupied)
    centres = grid.resolution * (np.column_stack((columns, rows)) + 0.5)
    if len(centres) == 0:
        return np.array(goal)
    distances = np.hypot(*(centres - goal).T)
    nearest = int(distances.argmin())
    return centres[nearest] if distances[nearest] <= GOAL_RADIUS else np.array(goal)
