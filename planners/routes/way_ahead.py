"""Where a vehicle at rest should go next: local goals around it, and how far it is from these to the goal."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.cutting import LONGEST_WAY
from planners.maps.global_path import GlobalPaths
from planners.world.arrays import Flags, Floats
from planners.world.problem import CANONICAL_DISTANCE, GOAL_RADIUS

HEADINGS: Final = 120  # directions looked at from a place
APART: Final = math.radians(15.0)  # between the local goals that are tried from one place
TURN_M: Final = 10.0  # metres of way that turning by a radian is worth
TIGHT_M: Final = 10.0  # metres of way that each metre is worth by which a place has too little room
ROOM_M: Final = 3.0  # to obstacles: enough to turn
IN_VAIN_M: Final = 15.0  # around a place from which a last leg failed: another would too
SHORT_M: Final = 40.0  # metres of way that a last leg too short for the memory is worth
ROLLED_M: Final = 4.0  # from the canonical distance to the goal: what may be rolled ahead or back
SHORT_LEGS_M: Final = (30.0, 15.0)  # how far along the way a leg leads where no canonical one can
_ARRIVED_M: Final = 1e6

Place = tuple[float, float]


class LocalGoal(NamedTuple):
    """Where a leg should lead."""

    place: Place  # metres
    canonical: bool  # it lies at the canonical distance, so a memory can be asked
    final: bool  # it is the route's goal


class WayAhead:
    """The shortest ways over a map's cells to one goal, seen from any pose; all lengths are canonical."""

    def __init__(self, paths: GlobalPaths, goal: Place) -> None:
        self.goal = goal
        self._in_vain: list[Place] = []
        self._ways = paths.ways_to(_free_place(paths, goal))
        self._cell_m = paths.grid.resolution
        free = ~paths.grid.occupied
        self._to_go = np.pad(self._ways.metres, 1, constant_values=math.inf)
        self._room = self._cell_m * np.pad(ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1], 1)
        # a vehicle may stand free in a cell that is not: the way begins beside it
        self._from_here = ndimage.minimum_filter(self._to_go, 3)

    def to_go(self, poses: Floats) -> Floats:
        """Metres of the shortest way from each of ``poses [n, >= 2]`` to the goal; infinite: none."""
        metres: Floats = self._at(self._from_here, poses[:, 0], poses[:, 1])
        return metres

    def outlook(self, poses: Floats) -> Floats:
        """Metres still to go after the best next leg from each of ``poses [n, >= 3]``, its trouble counted.

        Below 0 in the goal disc, and the less the nearer its middle.
        """
        costs: Floats = np.minimum(self._costs(poses).min(axis=1), self.to_go(poses) + SHORT_M)
        costs += TIGHT_M * np.maximum(ROOM_M - self._at(self._room, poses[:, 0], poses[:, 1]), 0.0)
        arrived = self.arrived(poses)
        costs[arrived] = self._distance(poses)[arrived] - _ARRIVED_M
        return costs

    def path(self, pose: Floats) -> Floats | None:
        """The shortest way ``[n, 2]`` over the cells from a pose ``[>= 2]`` to the goal; None: none."""
        column, row = np.floor(pose[:2] / self._cell_m).astype(int)
        around = [(column + right, row + up) for up in (0, 1, -1) for right in (0, 1, -1)]
        middles = self._cell_m * (np.array(around) + 0.5)
        to_go = self._at(self._to_go, middles[:, 0], middles[:, 1])
        best = int(to_go.argmin()) if to_go[0] == math.inf else 0
        return None if to_go[best] == math.inf else self._ways.path(middles[best])

    def give_up(self, pose: Floats) -> None:
        """Remember that from about a pose ``[>= 2]`` the goal cannot be reached in one leg."""
        self._in_vain.append((float(pose[0]), float(pose[1])))

    def arrived(self, poses: Floats) -> Flags:
        """Whether each of ``poses [n, >= 2]`` lies in the goal disc."""
        near: Flags = self._distance(poses) <= GOAL_RADIUS
        return near

    def local_goals(self, pose: Floats, most: int) -> list[LocalGoal]:
        """Local goals from a pose ``[>= 3]``, best first: ``most`` canonical ones or fewer, then short ones.

        The goal is among them where it is near enough.
        """
        costs = self._costs(pose[np.newaxis])[0]
        found: list[LocalGoal] = []
        headings: list[float] = []
        for i in np.argsort(costs, kind="stable"):
            if costs[i] == math.inf:
                break
            if i == HEADINGS:
                canonical = abs(math.dist(pose[:2], self.goal) - CANONICAL_DISTANCE) <= ROLLED_M
                found.append(LocalGoal(self.goal, canonical, True))
            elif len(headings) < most and all(_turn(_HEADINGS[i], each) >= APART for each in headings):
                headings.append(float(_HEADINGS[i]))
                x = pose[0] + CANONICAL_DISTANCE * math.cos(headings[-1])
                y = pose[1] + CANONICAL_DISTANCE * math.sin(headings[-1])
                found.append(LocalGoal((float(x), float(y)), True, False))
        if LocalGoal(self.goal, True, True) in found:
            found.append(LocalGoal(self.goal, False, True))  # where it cannot be faced, it can be searched
        way = self.path(pose)
        if way is not None:
            far = np.cumsum(np.hypot(*np.diff(way, axis=0).T))
            for metres in SHORT_LEGS_M:
                if len(far) and metres < far[-1]:
                    x, y = way[1 + int(np.searchsorted(far, metres))]
                    found.append(LocalGoal((float(x), float(y)), False, False))
        return found

    def _distance(self, poses: Floats) -> Floats:
        distance: Floats = np.hypot(poses[:, 0] - self.goal[0], poses[:, 1] - self.goal[1])
        return distance

    def _costs(self, poses: Floats) -> Floats:
        """Of ``poses [n, >= 3]`` the local goals' costs ``[n, HEADINGS + 1]``; the last is the goal."""
        to_go = self.to_go(poses)[:, np.newaxis]
        x = poses[:, :1] + CANONICAL_DISTANCE * np.cos(_HEADINGS)
        y = poses[:, 1:2] + CANONICAL_DISTANCE * np.sin(_HEADINGS)
        costs = self._at(self._to_go, x, y)
        with np.errstate(invalid="ignore"):
            gain = to_go - costs  # at least so long is the way to the local goal
        costs[~((gain > 0.0) & (gain <= LONGEST_WAY * CANONICAL_DISTANCE))] = math.inf
        beyond = np.hypot(x - self.goal[0], y - self.goal[1])
        costs[beyond < CANONICAL_DISTANCE - ROLLED_M] += SHORT_M  # the leg after that will be a short one
        costs += TIGHT_M * np.maximum(GOAL_RADIUS - self._at(self._room, x, y), 0.0)
        costs += TURN_M * np.abs(_wrapped(_HEADINGS - poses[:, 2:3]))
        distance = self._distance(poses)
        bearing = np.arctan2(self.goal[1] - poses[:, 1], self.goal[0] - poses[:, 0])
        off = np.abs(distance - CANONICAL_DISTANCE)
        last = np.where(off <= ROLLED_M, off + TURN_M * np.abs(_wrapped(bearing - poses[:, 2])), SHORT_M)
        near = distance <= CANONICAL_DISTANCE + ROLLED_M
        direct = to_go[:, 0] <= LONGEST_WAY * CANONICAL_DISTANCE
        last[~(near & direct)] = math.inf
        for place in self._in_vain:
            last[np.hypot(poses[:, 0] - place[0], poses[:, 1] - place[1]) < IN_VAIN_M] = math.inf
        return np.column_stack((costs, last))

    def _at(self, values: Floats, x: Floats, y: Floats) -> Floats:
        """The value of each place's cell, of ``values [rows + 2, columns + 2]``, a border around the map."""
        rows, columns = np.array(values.shape) - 1
        row = np.clip(np.floor(y / self._cell_m) + 1, 0, rows).astype(np.int64)
        column = np.clip(np.floor(x / self._cell_m) + 1, 0, columns).astype(np.int64)
        found: Floats = values[row, column]
        return found


_HEADINGS: Final = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)


def _turn(one: float, other: float) -> float:
    """The angle between two headings."""
    return abs(math.remainder(one - other, 2.0 * math.pi))


def _wrapped(angles: Floats) -> Floats:
    wrapped: Floats = (angles + math.pi) % (2.0 * math.pi) - math.pi
    return wrapped


def _free_place(paths: GlobalPaths, goal: Place) -> Floats:
    """The middle of the free cell nearest to the goal if its disc holds one, else the goal."""
    grid = paths.grid
    rows, columns = np.nonzero(~grid.occupied)
    middles = grid.resolution * (np.column_stack((columns, rows)) + 0.5)
    if len(middles) == 0:
        return np.array(goal)
    distances = np.hypot(*(middles - goal).T)
    nearest = int(distances.argmin())
    return middles[nearest] if distances[nearest] <= GOAL_RADIUS else np.array(goal)
