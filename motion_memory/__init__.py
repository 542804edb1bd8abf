"""Plan robot motions from experience: the public interface of Motion Memory (docs/python.md).

    memory = motion_memory.load("data/runs/…/memories/random")
    answer = memory.plan({"start": [0.0, 0.0, 0.785], "goal": [50.0, 50.0], …})

These names stay the same within a major version; modules of other packages may change.
"""

from __future__ import annotations

from importlib.metadata import version

from motion_memory.answers import Answer, RouteAnswer
from motion_memory.files import read_map, read_problems, read_worlds, solve_many
from motion_memory.loading import load
from motion_memory.memory import Memory
from planners.maps.occupancy_map import OccupancyMap
from planners.ranked_plans import RankedPlan
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import StorageError
from tasks.attempts.judged_attempts import PlanFaultError
from tasks.settings.errors import RunError, UsageError

__version__ = version("motion-memory")
__all__ = [
    "Answer",
    "Arrival",
    "Memory",
    "OccupancyMap",
    "Plan",
    "PlanFaultError",
    "Problem",
    "RankedPlan",
    "RouteAnswer",
    "RunError",
    "StorageError",
    "UsageError",
    "Vehicle",
    "load",
    "read_map",
    "read_problems",
    "read_worlds",
    "solve_many",
]
