"""An attempt made again: the same seed gives the same plan, and now it is at hand to be looked at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from planners.explanation import Recollection, recollections
from planners.memory.recall import Memory
from planners.search.query import Limits
from planners.search.traces import Roads, Trace, last_roadmap, last_tree
from planners.solve import WITHOUT_MEMORY, Attempt, solve, turned
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.tables.configurations import Configuration


class Again(NamedTuple):
    """An attempt, what it recalled, and what its search grew, in the canonical frame."""

    attempt: Attempt
    recalled: Sequence[tuple[Recollection, Plan]]  # best first, turned to the problem's start
    tree: Trace | None  # None where nothing was searched
    roadmap: Roads | None


def again(
    problem: Problem,
    planner: str,
    how: Configuration,
    memory: Memory | None,
    seed: int,
    vehicle: Vehicle,
    limits: Limits,
) -> Again:
    """Solve a canonical problem again; ValueError where memory and problem do not fit each other."""
    known = None if how.assist in WITHOUT_MEMORY else memory
    workspace = Workspace()
    attempt = solve(
        *(problem, planner, how.assist, max(how.top_k, 1), known, seed, limits, vehicle),
        strategy=how.recall or None,
        workspace=workspace,
    )
    searched = attempt.source == "searched" or not attempt.solved
    tree = last_tree(workspace, limits, vehicle) if searched else None
    roads = last_roadmap(workspace, planner) if searched and attempt.roadmap_seconds > 0.0 else None
    looked_at = recollections(problem, attempt, known, vehicle, workspace) if known is not None else []
    plans = [turned(known.plans[each.plan], problem.start[2]) for each in looked_at] if known else []
    return Again(attempt, list(zip(looked_at, plans, strict=True)), tree, roads)
