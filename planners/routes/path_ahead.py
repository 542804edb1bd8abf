"""Where a vehicle at rest should go next: local goals around it, and how far it is from them to the goal."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.cutting import LONGEST_PATH
from planners.maps.global_path import GlobalPaths
from planners.world.arrays import Flags, Floats, Point
from planners.world.problem import CANONICAL_DISTANCE, GOAL_RADIUS

HEADINGS: Final = 120  # directions of local goals
APART: Final = math.radians(15.0)  # least angle between the local goals that are tried from one stop
TURN_M: Final = 10.0  # cost of turning by a radian, in metres of path
TIGHT_M: Final = 10.0  # cost of each metre of clearance that a point lacks, in metres of path
ROOM_M: Final = 3.0  # clearance that is enough to turn
GIVEN_UP_M: Final = 15.0  # around a stop from which a last leg failed, another would fail, too
SHORT_M: Final = 40.0  # cost of a last leg too short for the memory, in metres of path
ROLLED_M: Final = 4.0  # how much nearer or farther than the canonical distance a goal may be, to roll there
SHORT_LEGS_M: Final = (30.0, 15.0)  # lengths of legs along the path to try if no canonical leg works
_ARRIVED_M: Final = 1e6


class LocalGoal(NamedTuple):
    """Where a leg should lead."""

    place: Point  # metres
    canonical: bool  # it is at the canonical distance, so that a memory can be used
    final: bool  # it is the route's goal


class PathAhead:
    """The shortest paths over a map's cells to one goal, from any pose. Lengths are canonical metres."""

    def __init__(self, paths: GlobalPaths, goal: Point) -> None:
        self.goal = goal
        self._given_up: list[Point] = []
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

    def outlook(self, poses: Floats) -> Floats:
        """Return the cost ``[n]`` of going on from each of ``poses [n, >= 3]`` with the best next leg.

        It is the metres of path that are left then, and what makes the leg difficult. In the goal disc it is
        negative, and the less the nearer to its centre.
        """
        costs: Floats = np.minimum(self._costs(poses).min(axis=1), self.to_go(poses) + SHORT_M)
        costs += TIGHT_M * np.maximum(ROOM_M - self._at(self._room, poses[:, 0], poses[:, 1]), 0.0)
        arrived = self.arrived(poses)
        costs[arrived] = self._distance(poses)[arrived] - _ARRIVED_M
        return costs

    def path(self, pose: Floats) -> Floats | None:
        """Return the shortest path ``[n, 2]`` over the cells from a pose ``[>= 2]``, or None."""
        column, row = np.floor(pose[:2] / self._cell_m).astype(int)
        around = [(column + right, row + up) for up in (0, 1, -1) for right in (0, 1, -1)]
        centres = self._cell_m * (np.array(around) + 0.5)
        to_go = self._at(self._to_go, centres[:, 0], centres[:, 1])
        best = int(to_go.argmin()) if to_go[0] == math.inf else 0
        return None if to_go[best] == math.inf else self._paths.path(centres[best])

    def give_up(self, pose: Floats) -> None:
        """Remember that the goal cannot be reached in one leg from near a pose ``[>= 2]``."""
        self._given_up.append((float(pose[0]), float(pose[1])))

    def arrived(self, poses: Floats) -> Flags:
        """Whether each of ``poses [n, >= 2]`` lies in the goal disc."""
        near: Flags = self._distance(poses) <= GOAL_RADIUS
        return near

    def local_goals(self, pose: Floats, most: int) -> list[LocalGoal]:
        """Return local goals from a pose ``[>= 3]``: at most ``most`` canonical ones, and short ones.

        The goal itself is among them if it is near enough.
        """
        costs = self._costs(pose[np.newaxis])[0]
        goals: list[LocalGoal] = []
        headings: list[float] = []
        for i in np.argsort(costs, kind="stable"):
            if costs[i] == math.inf:
                break
            if i == HEADINGS:
                canonical = abs(math.dist(pose[:2], self.goal) - CANONICAL_DISTANCE) <= ROLLED_M
                goals.append(LocalGoal(self.goal, canonical, True))
            elif len(headings) < most and all(_turn(_HEADINGS[i], each) >= APART for each in headings):
                headings.append(float(_HEADINGS[i]))
                x = pose[0] + CANONICAL_DISTANCE * math.cos(headings[-1])
                y = pose[1] + CANONICAL_DISTANCE * math.sin(headings[-1])
                goals.append(LocalGoal((float(x), float(y)), True, False))
        if LocalGoal(self.goal, True, True) in goals:
            goals.append(LocalGoal(self.goal, False, True))  # if it cannot be faced, it may still be searched
        path = self.path(pose)
        if path is not None:
            far = np.cumsum(np.hypot(*np.diff(path, axis=0).T))
            for metres in SHORT_LEGS_M:
                if len(far) and metres < far[-1]:
                    x, y = path[1 + int(np.searchsorted(far, metres))]
                    goals.append(LocalGoal((float(x), float(y)), False, False))
        return goals

    def _distance(self, poses: Floats) -> Floats:
        distance: Floats = np.hypot(poses[:, 0] - self.goal[0], poses[:, 1] - self.goal[1])
        return distance

    def _costs(self, poses: Floats) -> Floats:
        """The costs ``[n, HEADINGS + 1]`` of the local goals of ``poses [n, >= 3]``; the last is the goal."""
        to_go = self.to_go(poses)[:, np.newaxis]
        x = poses[:, :1] + CANONICAL_DISTANCE * np.cos(_HEADINGS)
        y = poses[:, 1:2] + CANONICAL_DISTANCE * np.sin(_HEADINGS)
        costs = self._at(self._to_go, x, y)
        with np.errstate(invalid="ignore"):
            gain = to_go - costs  # the path to the local goal is at least that long
        costs[~((gain > 0.0) & (gain <= LONGEST_PATH * CANONICAL_DISTANCE))] = math.inf
        beyond = np.hypot(x - self.goal[0], y - self.goal[1])
        costs[beyond < CANONICAL_DISTANCE - ROLLED_M] += SHORT_M  # the leg after that would be a short one
        costs += TIGHT_M * np.maximum(GOAL_RADIUS - self._at(self._room, x, y), 0.0)
        costs += TURN_M * np.abs(_wrapped(_HEADINGS - poses[:, 2:3]))
        distance = self._distance(poses)
        bearing = np.arctan2(self.goal[1] - poses[:, 1], self.goal[0] - poses[:, 0])
        off = np.abs(distance - CANONICAL_DISTANCE)
        last = np.where(off <= ROLLED_M, off + TURN_M * np.abs(_wrapped(bearing - poses[:, 2])), SHORT_M)
        near = distance <= CANONICAL_DISTANCE + ROLLED_M
        direct = to_go[:, 0] <= LONGEST_PATH * CANONICAL_DISTANCE
        last[~(near & direct)] = math.inf
        for stop in self._given_up:
            last[np.hypot(poses[:, 0] - stop[0], poses[:, 1] - stop[1]) < GIVEN_UP_M] = math.inf
        return np.column_stack((costs, last))

    def _at(self, values: Floats, x: Floats, y: Floats) -> Floats:
        """The value of the cell of each point, of ``values [rows + 2, columns + 2]`` with a border of one."""
        rows, columns = np.array(values.shape) - 1
        row = np.clip(np.floor(y / self._cell_m) + 1, 0, rows).astype(np.int64)
        column = np.clip(np.floor(x / self._cell_m) + 1, 0, columns).astype(np.int64)
        of_cells: Floats = values[row, column]
        return of_cells


_HEADINGS: Final = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)


def _turn(one: float, other: float) -> float:
    """The angle between two headings."""
    return abs(math.remainder(one - other, 2.0 * math.pi))


def _wrapped(angles: Floats) -> Floats:
    wrapped: Floats = (angles + math.pi) % (2.0 * math.pi) - math.pi
    return wrapped


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
