"""Judges plans on a map: whatever is occupied on it is in their way."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.world.alignment import Alignment, from_canonical
from planners.world.authority.authority import faults
from planners.world.problem import GOAL_RADIUS, Obstacles, Plan, Problem
from storage.exchange.plans import PlanRecord


class MapJudge:
    """Judges plans on one map, whatever their scales."""

    def __init__(self, world: OccupancyMap, tolerance_m: float = 0.0) -> None:
        """``world`` is the map; ``tolerance_m`` is how far the outlines of what is occupied may move."""
        self._world = world
        self._tolerance_m = tolerance_m
        self._obstacles = cache(self._obstacles_at)

    def faults(self, record: PlanRecord, plan: Plan) -> list[str]:
        """What is wrong with the ``plan`` of a ``record``, driven from its first state, goals left aside."""
        scale, (left, bottom, turn) = record.scale, self._world.origin
        x, y = (left - record.offset[0]) / scale, (bottom - record.offset[1]) / scale
        cos, sin = math.cos(turn), math.sin(turn)
        on_grid = from_canonical(plan, Alignment((-cos * x - sin * y, sin * x - cos * y), turn))
        first, last = on_grid.states[0].tolist(), on_grid.states[-1].tolist()
        width, height = self._world.size
        whole = Problem(
            self._world.name,
            self._world.name,
            (first[0], first[1], first[2]),
            (last[0], last[1]),
            GOAL_RADIUS,
            (0.0, 0.0, width / scale, height / scale),
            self._obstacles(scale),
            start_motion=tuple(first[3:]),
        )
        return faults(whole, on_grid, record.vehicle)

    def _obstacles_at(self, scale: float) -> Obstacles:
        """What is occupied, in metres of plans at that ``scale``."""
        canonical = replace(self._world, resolution=self._world.resolution / scale)
        return surroundings_of(canonical, 1.0, self._tolerance_m / scale).obstacles()
