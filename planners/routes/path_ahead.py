"""Where a vehicle should go next: places on the shortest path over a map, and the way to where it stops."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths
from planners.world.arrays import Flags, Floats, Point
from planners.world.geometry.collision import Scene, point_is_free
from planners.world.problem import CANONICAL_DISTANCE, GOAL_RADIUS, Arrival

REACHES_M: Final = (60.0, 35.0, 20.0, 10.0)  # along the path to the local goals, in the order of trial
SOUGHT_M: Final = 10.0  # before the end of a reach: so far back a place with more room is looked for
TIGHT_M: Final = 3.0  # of the path, given up for each metre of clearance that a place lacks
BESIDE_POSE_M: Final = 5.0  # from a pose, as in a slot narrower than a cell: so far away a path may end
SIGHT_M: Final = 0.2  # between points that are looked at along a line
AT_REST: Final = Arrival(least_speed=0.0, most_speed=0.0)
POSE_RADIUS: Final = 0.1  # metres
POSE_TOLERANCE: Final = 0.05  # radians


class Stop(NamedTuple):
    """Where a route stops: anywhere in a disc, or in a pose if the arrival has a heading."""

    place: Point  # metres
    radius: float = GOAL_RADIUS  # metres
    arrival: Arrival = AT_REST

    @property
    def is_pose(self) -> bool:
        """Whether the heading matters."""
        return self.arrival.heading is not None


class LocalGoal(NamedTuple):
    """Where a leg should lead."""

    place: Point  # metres
    radius: float  # metres
    arrival: Arrival | None  # what the plan itself has to keep; None: nothing
    final: bool  # it is where the route stops


class PathAhead:
    """The shortest paths over a map's cells to one stop, from anywhere. Lengths are canonical metres."""

    def __init__(self, paths: GlobalPaths, stop: Stop, scene: Scene) -> None:
        """``paths`` are those over a map's cells, ``scene`` is what is occupied on it."""
        self.stop = stop
        self._paths = paths.paths_to(_free_point(paths, stop, scene))
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
        """Return the metres ``[n]`` from ``poses [n, >= 2]`` to the place of the stop."""
        metres: Floats = np.hypot(poses[:, 0] - self.stop.place[0], poses[:, 1] - self.stop.place[1])
        return metres

    def arrived(self, states: Floats) -> Flags:
        """Whether the vehicle may stop in each of ``states [n, S]``."""
        there: Flags = self.distance(states) <= self.stop.radius
        asked = self.stop.arrival
        if asked.heading is not None:
            there = there & (_turns(states[:, 2] - asked.heading) <= asked.heading_tolerance)
        for i, (hitch, tolerance) in enumerate(zip(asked.hitches, asked.hitch_tolerances, strict=True)):
            there = there & (np.abs(states[:, 5 + i] - hitch) <= tolerance)
        return there

    def local_goals(self, pose: Floats) -> list[LocalGoal]:
        """Return local goals ahead of a pose ``[>= 2]``, in the order of trial.

        They lie on the shortest path, none farther than canonical goals. Where the path ends within the
        reach, the stop itself is the first.
        """
        path = self.path(pose)
        if path is None:
            return []
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        straight = np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1])
        lacking = np.maximum(GOAL_RADIUS - self._at(self._room, path[:, 0], path[:, 1]), 0.0)
        goals: list[LocalGoal] = []
        if along[-1] <= REACHES_M[0] and math.dist(pose[:2], self.stop.place) <= CANONICAL_DISTANCE:
            place, radius, arrival = self.stop
            goals += [LocalGoal(place, radius, asked, True) for asked in (None, arrival)][self.stop.is_pose :]
        for reach in REACHES_M:
            within = (along <= reach) & (along >= reach - SOUGHT_M) & (straight <= CANONICAL_DISTANCE)
            if reach < along[-1] and within.any():
                x, y = path[int(np.where(within, along - TIGHT_M * lacking, -math.inf).argmax())].tolist()
                goals.append(LocalGoal((x, y), GOAL_RADIUS, None, False))
        return goals

    def _at(self, values: Floats, x: Floats, y: Floats) -> Floats:
        """The value of the cell of each point, of ``values [rows + 2, columns + 2]`` with a border of one."""
        rows, columns = np.array(values.shape) - 1
        row = np.clip(np.floor(y / self._cell_m) + 1, 0, rows).astype(np.int64)
        column = np.clip(np.floor(x / self._cell_m) + 1, 0, columns).astype(np.int64)
        of_cells: Floats = values[row, column]
        return of_cells


def _free_point(paths: GlobalPaths, stop: Stop, scene: Scene) -> Floats:
    """The centre of the nearest free cell, one in sight of the stop if there is any; else the stop itself."""
    grid, place = paths.grid, np.array(stop.place)
    rows, columns = np.nonzero(~grid.occupied)
    centres = grid.resolution * (np.column_stack((columns, rows)) + 0.5)
    distances = np.hypot(*(centres - place).T)
    near = np.flatnonzero(distances <= (BESIDE_POSE_M if stop.is_pose else stop.radius))
    near = near[np.argsort(distances[near], kind="stable")]
    if len(near) == 0:
        return place
    seen = (i for i in near if _in_sight(place, centres[i], scene))
    nearest: Floats = centres[next(seen, near[0])]
    return nearest


def _in_sight(place: Floats, other: Floats, scene: Scene) -> bool:
    """Whether nothing lies on the line between two points ``[2]``."""
    count = 2 + int(math.dist(place, other) / SIGHT_M)
    return all(point_is_free(x, y, scene) for x, y in np.linspace(place, other, count).tolist())


def _turns(angles: Floats) -> Floats:
    """How far ``angles [n]`` (radians) are from whole turns."""
    turned: Floats = np.abs(np.remainder(angles + math.pi, math.tau) - math.pi)
    return turned
