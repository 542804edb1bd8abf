"""What is in the way of a plan that is judged without its problem: nothing, or what is occupied on a map."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Final

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.world.alignment import Alignment, from_canonical
from planners.world.authority.authority import faults
from planners.world.problem import GOAL_RADIUS, Obstacles, Plan, Problem, obstacles_of, starting_at
from storage.exchange.plans import PlanRecord

ROOM_M: Final = 1e6  # around a plan that is judged by itself


def by_itself(plan: Plan) -> Problem:
    """The problem that a plan answers where nothing is in its way."""
    x, y, heading = plan.states[0, :3].tolist()
    goal = (float(plan.states[-1, 0]), float(plan.states[-1, 1]))
    bounds = (x - ROOM_M, y - ROOM_M, x + ROOM_M, y + ROOM_M)
    problem = Problem("stored", "stored", (x, y, heading), goal, GOAL_RADIUS, bounds, obstacles_of([]))
    return starting_at(problem, plan.states[0])


class MapJudge:
    """Judges plans on one map, whatever their scales."""

    def __init__(self, world: OccupancyMap, tolerance_m: float = 0.0) -> None:
        """``world`` is the map; ``tolerance_m`` is how far the outlines of what is occupied may move."""
        self._world = world
        self._tolerance_m = tolerance_m
        self._obstacles = cache(self._obstacles_at)

    def faults(self, record: PlanRecord, plan: Plan) -> list[str]:
        """What is wrong with the ``plan`` of a ``record``, driven from its first state, goals left aside."""
        scale, (left, low, turned) = record.scale, self._world.origin
        x, y, turn = self._world.grid_pose(*record.offset, 0.0)
        on_grid = from_canonical(plan, Alignment((x / scale, y / scale), -turn))
        width, height = self._world.size
        bounds = (0.0, 0.0, width / scale, height / scale)
        lies_at = (0.0, 0.0) if turned else (left, low)
        whole = replace(
            by_itself(on_grid),
            bounds=bounds,
            obstacles=self._obstacles(scale),
            scale=scale,
            offset=lies_at,
        )
        found = faults(whole, on_grid, record.vehicle)
        where = " Places are in metres along the map's cells, as the map is turned."
        return [fault + where * (turned != 0.0 and "near (" in fault) for fault in found]

    def _obstacles_at(self, scale: float) -> Obstacles:
        """What is occupied, in metres of plans at that ``scale``."""
        canonical = replace(self._world, resolution=self._world.resolution / scale)
        return surroundings_of(canonical, 1.0, self._tolerance_m / scale).obstacles()
