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
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace

SEED: Final = 79


class Row(NamedTuple):
    """What a planner made of one problem."""

    attempt: Attempt
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


def attempted(problem: Problem, peer: Peer, vehicle: Vehicle, workspace: Workspace, seed: int) -> Row:
    """Attempt a problem in its own frame and have the plan judged there."""
    canonical, alignment = to_canonical(problem)
    attempt = solve(
        canonical,
        peer.planner,
        "none" if peer.library is None else "join",
        memory=peer.library,
        vehicle=vehicle,
        workspace=workspace,
        seed=seed,
    )
    if attempt.plan is not None and peer.optimised:
        better = optimise(canonical, attempt.plan, DEFAULT_SETTINGS, vehicle)
        plan = better.plan or attempt.plan  # where it does not converge the plan stays as it is
        seconds = attempt.planning_seconds + better.seconds
        attempt = replace(attempt, plan=plan, duration_s=plan.duration_s, planning_seconds=seconds)
    if attempt.plan is None:
        return Row(attempt, 0, None)
    plan = from_canonical(attempt.plan, alignment)
    found = faults(problem, plan, vehicle)
    return Row(attempt, len(cusps_of(plan, vehicle)), found[0] if found else None)
