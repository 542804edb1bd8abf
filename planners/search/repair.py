"""Repairs a plan that is blocked in places: only these places are planned anew (paper, III-D).

What is free before the first collision stays as it is and becomes the first branch of a tree, which grows
from there to a point where the plan is free again. A tracking controller follows the plan from that point on,
with every state simulated and checked. At the next collision the same begins again.

A repair that succeeds mostly costs less than a search, one that fails is lost. So it gives up where the way
around is long, and when it has cost its budget.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planners.search.guided import GuidedSearch
from planners.search.guides.grid_path import grid_path
from planners.search.guides.guidance import guidance
from planners.search.outcome import Outcome, Status, work_of
from planners.search.query import Query
from planners.search.tracking import ARRIVED, TRACKING, Tracking, track
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene, count_free_prefix, state_is_free
from planners.world.geometry.occupancy import Bits, window_of
from planners.world.goal import RADIUS, X, Y, goal_of, place
from planners.world.jit import jit, lean
from planners.world.problem import Plan
from planners.world.trigonometry import length
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size

TOO_LATE_STEPS = 10  # before a collision: a second, in which it is too late to turn away
LONGEST = 4096  # states of a repaired plan; a stored plan has some 250


@dataclass(frozen=True)
class RepairSettings:
    """How much a repair may cost before it is given up, and where it joins the plan again."""

    work: int = (
        1_000  # of all local searches and of tracking; GUST's and Follow's own search takes twice as much
    )
    rounds: int = 4  # local searches
    detour_m: float = (
        6.0  # a way around over the grid that is longer than straight on by more than this is too long
    )
    rejoin_radius_m: float = 2.0
    rejoin_beyond_m: float = 5.0  # from the end of the free part; twice as far after each failure
    free_steps: int = 5  # steps for which the plan must be free where it is joined
    tracking: Tracking = TRACKING


REPAIR = RepairSettings()


def free_prefix(stored: Plan, scene: Scene, vehicle: Vehicle = CAR) -> tuple[Plan | None, int]:
    """Return the plan until shortly before its first blocked state, and how many states were checked.

    There is no such plan if the very first state is blocked.
    """
    free = int(count_free_prefix(np.ascontiguousarray(stored.states), vehicle, scene))
    return shortened(stored, free) if free else None, min(free + 1, len(stored.states))


def shortened(drive: Plan, free: int) -> Plan:
    """Return the first ``free`` states of a drive, less ``TOO_LATE_STEPS``."""
    kept = max(free - TOO_LATE_STEPS, 1)
    return Plan(drive.states[:kept], drive.controls[: kept - 1], drive.dt)


@lean
def rejoin_at(
    states: Floats,
    after: int,
    x: float,
    y: float,
    beyond_m: float,
    steps: int,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[int, int]:
    """The first of ``states [T, S]`` from ``after`` on that begins ``steps`` free ones far from (x, y).

    It is at least ``beyond_m`` metres away, or the last state if there is none. Returned with how many states
    were checked.
    """
    last = states.shape[0] - 1
    free = 0
    checks = 0
    for i in range(after, last):
        if length(states[i, 0] - x, states[i, 1] - y) < beyond_m:
            free = 0
            continue
        checks += 1
        free = free + 1 if state_is_free(load(states, i, vehicle), vehicle, scene) else 0
        if free >= steps:
            return i - steps + 1, checks
    return last, checks


@jit
def metres_along(path: Floats, x: float, y: float) -> float:
    """The length of the way from (x, y) along the points of a path ``[n, 2]``."""
    metres = 0.0
    for i in range(path.shape[0]):
        metres += length(path[i, 0] - x, path[i, 1] - y)
        x = path[i, 0]
        y = path[i, 1]
    return metres


def allocate_drive(size: int) -> tuple[Floats, Floats]:
    """Buffers for the states ``[LONGEST, size]`` and controls of a repaired plan."""
    return np.empty((LONGEST, size)), np.empty((LONGEST, 2))


def repair(
    query: Query, stored: Plan, drive: Plan, occupied: Bits, settings: RepairSettings = REPAIR
) -> Outcome:
    """Turn a stored plan that is blocked in places into a plan for the query's problem.

    Args:
        query: the problem; the plan begins at its start. Guide, limits and prefix are not looked at.
        stored: the plan.
        drive: what is free of it before it is first blocked, the ``free_prefix``.
        occupied: ``[64]`` the problem's occupied cells, which show a way around.
        settings: what the repair may cost.

    Returns:
        The repaired plan with status ``SOLVED``, or no plan with ``BUDGET_SPENT``.
    """
    began = working_clock()
    problem, scene, vehicle, workspace = query.problem, query.scene, query.vehicle, query.workspace
    reference = np.ascontiguousarray(stored.states)
    states, controls = workspace.buffers(allocate_drive, state_size(vehicle))
    goal, window = goal_of(problem, vehicle), window_of(problem)
    at = len(drive.states)  # the reference state from which to look for a free part
    beyond_m = settings.rejoin_beyond_m
    checks = expansions = nodes = 0
    solved = False
    for _ in range(settings.rounds):
        x, y = drive.states[-1, :2].tolist()
        after = min(at, len(reference) - 1)
        at, checked = rejoin_at(reference, after, x, y, beyond_m, settings.free_steps, vehicle, scene)
        checks += checked
        to_goal = at == len(reference) - 1
        disc = goal
        if not to_goal:
            disc = place(float(reference[at, 0]), float(reference[at, 1]), settings.rejoin_radius_m)
        target, radius = (float(disc[X]), float(disc[Y])), float(disc[RADIUS])
        around = grid_path(occupied, (x, y), target, radius, workspace, window)
        straight = float(np.hypot(target[0] - x, target[1] - y)) - radius
        if around is None or metres_along(around, x, y) > straight + settings.detour_m:
            break
        arrival = problem.arrival if to_goal else None
        asked = replace(problem, goal=target, goal_radius=radius, arrival=arrival)
        local = replace(query, problem=asked)
        search = GuidedSearch(local, guidance([around, drive.states]), drive)
        beyond = search.advance(settings.work - work_of(checks, expansions))
        checks += search.collision_checks
        expansions += search.expansions
        nodes += search.nodes
        if beyond is not None:
            drive, solved = beyond, to_goal
        else:
            beyond_m *= 2.0
        if beyond is not None and not solved:
            last = len(drive.states) - 1
            if last >= len(controls):
                break  # vehicles of short steps and low speeds may be that long under way
            states[: last + 1], controls[:last] = drive.states, drive.controls
            ended, end, at = track(
                *(states, controls, last, reference, at, goal, settings.tracking, vehicle, scene)
            )
            checks += end - last
            solved = ended == ARRIVED
            drive = Plan(states[: end + 1].copy(), controls[:end].copy(), vehicle.dt)
            if not solved:
                drive = shortened(drive, end + 1)
        if solved or work_of(checks, expansions) >= settings.work:
            break
    return Outcome(
        status=Status.SOLVED if solved else Status.BUDGET_SPENT,
        plan=drive if solved else None,
        collision_checks=int(checks),
        expansions=expansions,
        nodes=nodes,
        roadmap_seconds=0.0,
        search_seconds=working_clock() - began,
    )
