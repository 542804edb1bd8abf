"""Where a vehicle should go next: places on the shortest path over a map, and the way to where it stops."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths, PathsTo
from planners.world.arrays import Flags, Floats, Point
from planners.world.geometry.collision import Scene, point_is_free
from planners.world.problem import CANONICAL_DISTANCE, GOAL_RADIUS, Arrival
from planners.world.trigonometry import all_wrapped
from planners.world.vehicles.vehicle import FIRST_HITCH

REACHES_M: Final = (60.0, 35.0, 20.0, 10.0)  # along the path to the local goals, in the order of trial
SOUGHT_M: Final = 10.0  # before the end of a reach: so far back a place with more room is looked for
TIGHT_M: Final = 3.0  # of the path, given up for each metre of clearance that a place lacks
BESIDE_M: Final = 10.0  # from a pose, as in a slot narrower than a cell: so far away a path may begin or end
NEAR_M: Final = 12.0  # of the path to a pose, which is then asked for as long as need be
SIGHT_M: Final = 0.2  # between points that are looked at along a line
AT_REST: Final = Arrival(least_speed=0.0, most_speed=0.0)


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
    brief: bool = False  # the search for it soon gives up, since it is far and nearer goals come next


class PathAhead:
    """The shortest paths over a map's cells to one stop, from anywhere. Lengths are canonical metres."""

    def __init__(
        self, paths: GlobalPaths, stop: Stop, scene: Scene, start: Floats, briefly: bool = False
    ) -> None:
        """Find the paths.

        Args:
            paths: those over a map's cells.
            stop: where they lead. They end in the nearest free cell that is seen from it, of those that a
                way leads to; if none is seen, in the stop's own cell; if that is not free there is no way.
            scene: what is occupied on the map.
            start: ``[>= 2]`` from where the vehicle comes.
            briefly: whether a pose is never asked for as long as need be.
        """
        self.briefly = briefly
        self.stop, self._scene, self._grid, self._spots = stop, scene, paths.grid, paths.spots
        self._cell_m = paths.grid.resolution
        self._room = np.pad(paths.room, 1)
        place = np.array(stop.place)
        cells = self._free_cells(place, max(stop.radius, BESIDE_M * stop.is_pose))
        seen = (cell for cell in cells if _in_sight(place, cell, scene))
        self._lead(paths.paths_to(next(seen, place)))
        for cell in seen:
            if self.path(start) is not None:
                break
            if self._at(self._to_go, cell[:1], cell[1:])[0] == math.inf:  # in another part of the map
                self._lead(paths.paths_to(cell))

    def _lead(self, paths: PathsTo) -> None:
        self._paths = paths
        self._to_go = np.pad(paths.metres, 1, constant_values=math.inf)
        # a vehicle may stand free in a cell that is not free: then the path begins beside it
        self._from_beside = ndimage.minimum_filter(self._to_go, 3)

    def to_go(self, poses: Floats) -> Floats:
        """Return the metres ``[n]`` of shortest paths from ``poses [n, >= 2]``; infinite: no path."""
        metres: Floats = self._at(self._from_beside, poses[:, 0], poses[:, 1])
        for i in np.flatnonzero(np.isinf(metres) & ~self._is_free(poses)):
            place = poses[i, :2]
            cells = self._free_cells(place, BESIDE_M)
            ways = self._at(self._to_go, cells[:, 0], cells[:, 1]) + np.hypot(*(cells - place).T)
            metres[i] = ways.min(initial=math.inf)
        return metres

    def path(self, pose: Floats) -> Floats | None:
        """Return the shortest path ``[n, 2]`` over the cells from a pose ``[>= 2]``, or None."""
        column, row = np.floor(pose[:2] / self._cell_m).astype(int)
        around = [(column + right, row + up) for up in (0, 1, -1) for right in (0, 1, -1)]
        middles = self._cell_m * (np.array(around) + 0.5)
        to_go = self._at(self._to_go, middles[:, 0], middles[:, 1])
        best = int(to_go.argmin()) if to_go[0] == math.inf else 0
        if to_go[best] < math.inf:
            return self._paths.path(middles[best])
        if self._is_free(pose[np.newaxis])[0]:  # but no way leads out of this part of the map
            return None
        cells = self._free_cells(pose[:2], BESIDE_M)
        cells = cells[np.isfinite(self._at(self._to_go, cells[:, 0], cells[:, 1]))]
        seen = (cell for cell in cells if _in_sight(pose[:2], cell, self._scene))
        begin = next(seen, None)
        return None if begin is None else self._paths.path(begin)

    def _free_cells(self, place: Floats, reach: float) -> Floats:
        """The spots ``[n, 2]`` of free cells within some metres of a place ``[2]``, the nearest first."""
        (left, low), (right, high) = (
            np.floor((place + by) / self._cell_m).astype(int) for by in (-reach, reach)
        )
        left, low = max(left, 0), max(low, 0)
        window = slice(low, high + 1), slice(left, right + 1)
        spots = self._spots[window][~self._grid.occupied[window]]
        distances = np.hypot(*(spots - place).T)
        order = np.argsort(distances, kind="stable")
        nearest: Floats = spots[order[: np.searchsorted(distances[order], reach, side="right")]]
        return nearest

    def _is_free(self, poses: Floats) -> Flags:
        """Whether the cell of each of ``poses [n, >= 2]`` is free."""
        free: Flags = self._at(self._room, poses[:, 0], poses[:, 1]) > 0.0
        return free

    def distance(self, poses: Floats) -> Floats:
        """Return the metres ``[n]`` from ``poses [n, >= 2]`` to the place of the stop."""
        metres: Floats = np.hypot(poses[:, 0] - self.stop.place[0], poses[:, 1] - self.stop.place[1])
        return metres

    def arrived(self, states: Floats) -> Flags:
        """Whether the vehicle may stop in each of ``states [n, S]``."""
        there: Flags = self.distance(states) <= self.stop.radius
        asked = self.stop.arrival
        if asked.heading is not None:
            off = np.abs(all_wrapped(states[:, 2] - asked.heading))
            there = there & (off <= asked.heading_tolerance)
        for i, (hitch, tolerance) in enumerate(zip(asked.hitches, asked.hitch_tolerances, strict=True)):
            there = there & (np.abs(states[:, FIRST_HITCH + i] - hitch) <= tolerance)
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
            if not self.stop.is_pose:
                goals.append(LocalGoal(place, radius, None, True))
            brief = self.stop.is_pose and (self.briefly or along[-1] > NEAR_M)
            goals.append(LocalGoal(place, radius, arrival, True, brief))
        for reach in REACHES_M:
            within = (along <= reach) & (along >= reach - SOUGHT_M) & (straight <= CANONICAL_DISTANCE)
            if reach < along[-1] and within.any():
                x, y = path[int(np.where(within, along - TIGHT_M * lacking, -math.inf).argmax())].tolist()
                goals.append(LocalGoal((x, y), GOAL_RADIUS, None, False))
        if not self.briefly:  # where nothing nearer led on
            goals += [goal._replace(brief=False) for goal in goals if goal.brief]
        return goals

    def _at(self, values: Floats, x: Floats, y: Floats) -> Floats:
        """The value of the cell of each point, of ``values [rows + 2, columns + 2]`` with a border of one."""
        rows, columns = np.array(values.shape) - 1
        row = np.clip(np.floor(y / self._cell_m) + 1, 0, rows).astype(np.int64)
        column = np.clip(np.floor(x / self._cell_m) + 1, 0, columns).astype(np.int64)
        of_cells: Floats = values[row, column]
        return of_cells


def _in_sight(place: Floats, other: Floats, scene: Scene) -> bool:
    """Whether nothing lies on the line between two points ``[2]``."""
    count = 2 + int(math.dist(place, other) / SIGHT_M)
    return all(point_is_free(x, y, scene) for x, y in np.linspace(place, other, count).tolist())
