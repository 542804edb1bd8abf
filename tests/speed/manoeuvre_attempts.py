"""One attempt at a manoeuvre: by whom, and what the authority said of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

from planners.attempt import Attempt
from planners.memory.library.plan_library import PlanLibrary
from planners.optimisation.optimise import DEFAULT_SETTINGS, optimise
from planners.solve import solve
from planners.world.alignment import from_canonical, to_canonical
from planners.world.authority.authority import faults
from planners.world.driving_cost import cusps_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Car, Vehicle
from planners.world.workspace import Workspace
from tests.speed.peers.hybrid_astar import hybrid_astar

SEED: Final = 79
HYBRID_ASTAR: Final = "hybrid-astar"
OMPL: Final = {  # how long each has: the first finds a path, the others go on to shorten it
    "RRTConnect": 5.0,
    "BITstar": 1.0,
    "InformedRRTstar": 1.0,
}
OTHERS: Final = (HYBRID_ASTAR, *OMPL)


class OfOthers(NamedTuple):
    """What a planner that is not ours made of a problem; named as in ``Attempt``."""

    problem_id: str
    plan: Plan | None
    planning_seconds: float
    source: str | None = None

    @property
    def solved(self) -> bool:
        return self.plan is not None

    @property
    def duration_s(self) -> float | None:
        return None if self.plan is None else self.plan.duration_s


class Row(NamedTuple):
    """What a planner made of one problem."""

    attempt: Attempt | OfOthers
    gear_changes: int
    fault: str | None  # the authority's first


class Peer(NamedTuple):
    """How a problem is attempted: a planner, its help, and whether the plan is optimised."""

    planner: str
    optimised: bool
    library: PlanLibrary | None = None  # plans to recall and to join

    def __str__(self) -> str:
        name = self.planner if self.library is None else f"{self.planner}, join"
        return f"{name}, optimised" if self.optimised else name


def _of_others(problem: Problem, planner: str, vehicle: Car, workspace: Workspace, seed: int) -> OfOthers:
    """What a planner that is not ours makes of a canonical problem."""
    if planner == HYBRID_ASTAR:
        plan, seconds, _ = hybrid_astar(problem, vehicle, workspace)
    else:
        from tests.speed.peers.reeds_shepp import reeds_shepp_plan  # late: OMPL may not be installed

        plan, seconds = reeds_shepp_plan(problem, vehicle, planner, seed, OMPL[planner], workspace)
    return OfOthers(problem.id, plan, seconds)


def attempted(problem: Problem, peer: Peer, vehicle: Vehicle, workspace: Workspace, seed: int) -> Row:
    """Attempt a problem in its own frame and have the plan judged there."""
    canonical, alignment = to_canonical(problem)
    attempt: Attempt | OfOthers
    if peer.planner in OTHERS:
        attempt = _of_others(canonical, peer.planner, vehicle, workspace, seed)
    else:
        attempt = solve(
            canonical,
            peer.planner,
            "none" if peer.library is None else "join",
            memory=peer.library,
            vehicle=vehicle,
            workspace=workspace,
            seed=seed,
        )
    if isinstance(attempt, Attempt) and attempt.plan is not None and peer.optimised:
        better = optimise(canonical, attempt.plan, DEFAULT_SETTINGS, vehicle)
        plan = better.plan or attempt.plan  # where it does not converge the plan stays as it is
        seconds = attempt.planning_seconds + better.seconds
        attempt = replace(attempt, plan=plan, duration_s=plan.duration_s, planning_seconds=seconds)
    if attempt.plan is None:
        return Row(attempt, 0, None)
    plan = from_canonical(attempt.plan, alignment)
    wrong = faults(problem, plan, vehicle)
    return Row(attempt, len(cusps_of(plan, vehicle)), wrong[0] if wrong else None)
