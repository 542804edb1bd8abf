"""Answers a question for a pose at rest by a whole stored drive: moved to the question, then optimised.

The stored drive says which way to take: how often to change gear, and on which side to pass. The optimisation
makes it free, exact and quick. That takes a few milliseconds; a search has to find the way first. If a drive
takes much longer than it would without obstacles, and than drives from nearby take, it may be of the wrong
kind, and a search looks for others.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.library.drives import TRIED, moved_drive, rank_drives
from planners.memory.library.plan_library import PlanLibrary
from planners.optimisation.descent import arrives
from planners.optimisation.polish import polish_guesses
from planners.search.connection.pose_table import seconds_from, seconds_to_pose
from planners.search.manoeuvres.suitability import is_tight
from planners.search.manoeuvres.variants import without_trailers
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.goal import HEADING, X, Y, goal_of
from planners.world.jit import jit
from planners.world.problem import Arrival, Plan, Problem, obstacles_of, start_state
from planners.world.vehicles.vehicle import Vehicle
from planners.world.view import View

# By how much drives may begin elsewhere, in lengths and radians together. Where the goal is not tight a
# search is quick, and only a near drive is worth a try.
FAR: Final = 1.5
FAR_IF_TIGHT: Final = 3.0
AT_ONCE: Final = 2  # drives of which the quicker one is the answer
# The longer a drive takes, the more others may gain: a pair is tried for each so many square seconds of it.
SQUARE_SECONDS: Final = 100.0
# A drive may not be the best if it costs more than both of these allow.
LONG: Final = 1.5  # times what it would take without obstacles
UNUSUAL: Final = 1.3  # times what the cheapest of the stored drives costs that begin nearest


class DriveAnswer(NamedTuple):
    """What whole stored drives have for a question. By default nothing."""

    plan: Plan | None = None
    number: int = -1  # of the library's plan that was moved
    entry: int = 0  # of its drive, as in the order of ``rank_drives``
    is_long: bool = False  # whether a search may well find a quicker one
    checks: int = 0  # collision checks that choosing took


def first_question(library: PlanLibrary, scale: float) -> Problem | None:
    """The question that the first stored drive answered, without obstacles: it compiles what drives need.

    Args:
        library: of drives.
        scale: of the question.

    Returns:
        The question in the drive's own frame; None if there is no drive.
    """
    if not len(library.drives.plans):
        return None
    states = library.plans[int(library.drives.plans[0])].states
    (x, y, heading, *motion), last = states[0].tolist(), states[-1].tolist()
    reach = float(np.abs(states[:, :2]).max()) + 30.0
    return Problem(
        *("warm", "warm", (x, y, heading), (last[0], last[1]), 0.1, (-reach, -reach, reach, reach)),
        *(obstacles_of([]), scale, tuple(motion)),
        arrival=Arrival(last[2], 0.05, 0.0, 0.0),
    )


def _seconds_without_obstacles(start: Floats, goal: Floats, vehicle: Vehicle) -> float:
    """What a drive from rest to rest takes, in seconds, if nothing is in the way; trailers do not count."""
    return _seconds(start, goal, seconds_to_pose(without_trailers(vehicle)), vehicle.max_speed)


@jit
def _seconds(start: Floats, goal: Floats, table: Floats, top: float) -> float:
    return seconds_from(start[0], start[1], start[2], (goal[X], goal[Y], goal[HEADING]), table, top)


def drive_answer(
    library: PlanLibrary,
    view: View,
    vehicle: Vehicle,
    until: float,
    blindly: np.random.Generator | None = None,
) -> DriveAnswer:
    """Move stored drives to a question for a pose at rest, two at a time, until one becomes a plan.

    Where that takes long to drive, some more are tried for a quicker one.

    Args:
        library: of the vehicle's plans.
        view: the question.
        vehicle: what is to be driven.
        until: when to end, by ``working_clock``.
        blindly: picks any drives; None picks those that promise most.
    """
    drives, problem = library.drives, view.problem
    start, goal = start_state(problem, vehicle), goal_of(problem, vehicle)
    if arrives(start, goal, vehicle):
        return DriveAnswer()  # nothing has to be driven
    order = np.zeros(TRIED, np.int32)
    if blindly is None:
        most = FAR_IF_TIGHT if is_tight(goal, vehicle, view.scene) else FAR
        count, cheapest, checks = rank_drives(drives, start, goal, most, order, vehicle, view.scene)
    else:
        count, cheapest, checks = min(TRIED, len(drives.plans)), 0, 0
        order[:count] = blindly.integers(-len(drives.plans), len(drives.plans), count)
    view.lap("recall")
    found, cost = DriveAnswer(checks=int(checks)), math.inf
    for k in range(0, count, AT_ONCE):
        if working_clock() > until:
            break
        entries = [int(entry) for entry in order[k : min(k + AT_ONCE, count)]]
        guesses = [moved_drive(drives, entry, start, goal, vehicle.dt) for entry in entries]
        ends = until, cost
        chosen, polished = polish_guesses(problem, guesses, vehicle, view.scene, view.workspace, *ends)
        if polished.plan is not None:
            entry = entries[chosen]
            number = int(drives.plans[max(entry, -1 - entry)])
            found = found._replace(plan=polished.plan, number=number, entry=entry)
            cost = cost_of(polished.plan, vehicle)
        if found.plan is not None and found.plan.duration_s**2 < SQUARE_SECONDS * (1 + k // AT_ONCE):
            break
    if found.plan is not None:
        without = _seconds_without_obstacles(start, goal, vehicle)
        usual = max(LONG * without, UNUSUAL * cheapest * vehicle.dt)
        found = found._replace(is_long=cost > usual)
    view.lap("repair")
    return found
