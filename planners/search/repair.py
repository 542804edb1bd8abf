"""Repairs a plan that is blocked in places: only these places are planned anew (paper, III-D).

What is free before the first collision stays as it is and becomes the first branch of a tree. The planner
searches from there to a point where the plan is free again. A tracking controller follows the plan from that
point on, with every state simulated and checked. At the next collision the same begins again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from planners.search.guides.grid_path import grid_path
from planners.search.guides.guidance import guidance
from planners.search.outcome import Outcome, Status
from planners.search.query import Limits, Query
from planners.search.registry import PLANNERS
from planners.search.tracking import ARRIVED, TRACKING, Tracking, track
from planners.world.arrays import Flags, Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.geometry.occupancy import Bits
from planners.world.jit import lean
from planners.world.problem import Plan
from planners.world.trigonometry import length
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size

TOO_LATE_STEPS = 10  # before a collision: a second, in which it is too late to turn away
LONGEST = 4096  # states of a repaired plan; a stored plan has some 250


@dataclass(frozen=True)
class RepairSettings:
    """How much a repair may cost before it is given up, and where it joins the plan again."""

    expansions: int = 150  # of each local search; from scratch a planner needs several hundred
    rounds: int = 4  # local searches
    rejoin_radius_m: float = 2.0
    rejoin_beyond_m: float = 5.0  # from the end of the free part; twice as far after each failure
    free_steps: int = 5  # steps for which the plan must be free where it is joined
    tracking: Tracking = TRACKING


REPAIR = RepairSettings()


@lean
def _fill_blocked(states: Floats, vehicle: Vehicle, scene: Scene, blocked: Flags) -> None:
    for i in range(states.shape[0]):
        blocked[i] = not state_is_free(load(states, i, vehicle), vehicle, scene)


def blocked_states(stored: Plan, scene: Scene, vehicle: Vehicle = CAR) -> tuple[Flags, int]:
    """Return which of a plan's states are not free ``[T]``, and how many were checked."""
    blocked = np.empty(len(stored.states), np.bool_)
    _fill_blocked(np.ascontiguousarray(stored.states), vehicle, scene, blocked)
    return blocked, len(blocked)


def free_prefix(stored: Plan, blocked: Flags) -> Plan | None:
    """Return the plan until shortly before its first blocked state; None if that is the very first."""
    free = int(blocked.argmax()) if blocked.any() else len(blocked)
    return shortened(stored, free) if free else None


def shortened(drive: Plan, free: int) -> Plan:
    """Return the first ``free`` states of a drive, less ``TOO_LATE_STEPS``."""
    kept = max(free - TOO_LATE_STEPS, 1)
    return Plan(drive.states[:kept], drive.controls[: kept - 1], drive.dt)


@lean
def rejoin_at(
    states: Floats, blocked: Flags, after: int, x: float, y: float, beyond_m: float, steps: int
) -> int:
    """The first of ``states [T, S]`` from ``after`` on that begins ``steps`` free ones far from (x, y).

    It is at least ``beyond_m`` metres away, or the last state if there is none.
    """
    last = states.shape[0] - 1
    free = 0
    for i in range(after, last):
        free = 0 if blocked[i] else free + 1
        begin = i - steps + 1
        if free >= steps and length(states[begin, 0] - x, states[begin, 1] - y) >= beyond_m:
            return begin
    return last


def allocate_drive(size: int) -> tuple[Floats, Floats]:
    """Buffers for the states ``[LONGEST, size]`` and controls of a repaired plan."""
    return np.empty((LONGEST, size)), np.empty((LONGEST, 2))


def repair(
    name: str, query: Query, stored: Plan, blocked: Flags, occupied: Bits, settings: RepairSettings = REPAIR
) -> Outcome:
    """Turn a stored plan that is blocked in places into a plan for the query's problem.

    Args:
        name: of the planner that searches around the blocked places.
        query: the problem; the plan begins at its start. Guide, limits and prefix are not looked at.
        stored: the plan, with T states.
        blocked: ``[T]`` which of its states are in collision.
        occupied: ``[64]`` the problem's occupied cells, which show the planner a way around.
        settings: what the repair may cost.

    Returns:
        The repaired plan with status ``SOLVED``, or no plan with ``BUDGET_SPENT``.
    """
    began = perf_counter()
    problem, scene, vehicle, workspace = query.problem, query.scene, query.vehicle, query.workspace
    reference = np.ascontiguousarray(stored.states)
    states, controls = workspace.buffers(allocate_drive, state_size(vehicle))
    goal = np.array([*problem.goal, problem.goal_radius])
    drive = free_prefix(stored, blocked)
    at = 0 if drive is None else len(drive.states)  # the reference state from which to look for a free part
    beyond_m = settings.rejoin_beyond_m
    searches: list[Outcome] = []
    tracked = 0
    solved = False
    while drive is not None and not solved and len(searches) < settings.rounds:
        x, y = drive.states[-1, :2].tolist()
        after = min(at, len(reference) - 1)
        at = int(rejoin_at(reference, blocked, after, x, y, beyond_m, settings.free_steps))
        to_goal = at == len(reference) - 1
        disc = goal if to_goal else np.array([*reference[at, :2], settings.rejoin_radius_m])
        target = (float(disc[0]), float(disc[1]))
        around = grid_path(occupied, (x, y), target, float(disc[2]), workspace)
        guide = guidance([drive.states] if around is None else [around, drive.states])
        local = replace(problem, goal=target, goal_radius=float(disc[2]))
        limits = Limits(expansions=settings.expansions)
        outcome = PLANNERS[name](replace(query, problem=local, guide=guide, limits=limits, prefix=drive))
        searches.append(outcome)
        if outcome.plan is None:
            beyond_m *= 2.0
            continue
        drive, solved = outcome.plan, to_goal
        if not solved:
            last = len(drive.states) - 1
            states[: last + 1], controls[:last] = drive.states, drive.controls
            ended, end, at = track(
                *(states, controls, last, reference, at, goal, settings.tracking, vehicle, scene)
            )
            tracked += end - last
            solved = ended == ARRIVED
            drive = Plan(states[: end + 1].copy(), controls[:end].copy(), vehicle.dt)
            if not solved:
                drive = shortened(drive, end + 1)
    roadmap_seconds = sum(each.roadmap_seconds for each in searches)
    return Outcome(
        status=Status.SOLVED if solved else Status.BUDGET_SPENT,
        plan=drive if solved else None,
        collision_checks=tracked + sum(each.collision_checks for each in searches),
        expansions=sum(each.expansions for each in searches),
        nodes=sum(each.nodes for each in searches),
        roadmap_seconds=roadmap_seconds,
        search_seconds=perf_counter() - began - roadmap_seconds,
    )
