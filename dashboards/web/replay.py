"""An attempt made again, to be looked at: the same seed gives the same plan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from planners.attempt import WITHOUT_MEMORY, Attempt
from planners.explanation import Recollection, recollections
from planners.memory.memory import Memory
from planners.memory.plans.free import turned
from planners.search.query import Limits
from planners.search.traces import Roads, Trace, last_roadmap, last_tree
from planners.solve import solve
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.tables.configurations import Configuration


class Replay(NamedTuple):
    """An attempt, what it recalled, and what its search grew, in the canonical frame."""

    attempt: Attempt
    recalled: Sequence[tuple[Recollection, Plan]]  # best first, turned to the problem's start
    tree: Trace | None  # None if nothing was searched
    roadmap: Roads | None


def replay(
    problem: Problem,
    planner: str,
    configuration: Configuration,
    memory: Memory | None,
    seed: int,
    vehicle: Vehicle,
    limits: Limits,
) -> Replay:
    """Solve a canonical ``problem`` again, with what a row says of the attempt.

    Args:
        problem: canonical.
        planner: name of the planner.
        configuration: assist and recall of the attempt.
        memory: the memory; ignored by a configuration that uses none.
        seed: seed of the search.
        vehicle: the vehicle that drives.
        limits: limits of the search.

    Raises:
        ValueError: memory and problem do not fit each other.
    """
    used = None if configuration.assist in WITHOUT_MEMORY else memory
    assist, recall, top_k, polished = configuration
    workspace = Workspace()
    asked = problem, planner, assist, max(top_k, 1), used, seed, limits, vehicle, recall or None
    attempt = solve(*asked, workspace, polished=polished)
    searched = attempt.source == "searched" or not attempt.solved
    tree = last_tree(workspace, limits, vehicle) if searched else None
    roadmap = last_roadmap(workspace, planner) if searched and attempt.roadmap_seconds > 0.0 else None
    if used is None:
        return Replay(attempt, [], tree, roadmap)
    recalled = [
        (recollection, turned(used.plans[recollection.plan], problem.start[2]))
        for recollection in recollections(problem, attempt, used, vehicle, workspace)
    ]
    return Replay(attempt, recalled, tree, roadmap)
