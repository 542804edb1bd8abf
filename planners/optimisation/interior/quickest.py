"""Makes a drive that must arrive as asked as quick as it can be, by moving all states and controls at once.

First the length of a step is free, and time counts. Then the drive is divided into whole steps of the vehicle
again, and only its gaps are closed. What its controls lead to is the answer if it is free and arrives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from planners.optimisation.arrival_error import USUAL
from planners.optimisation.gaps import Barrier, circles_around
from planners.optimisation.guesses import resampled
from planners.optimisation.interior.buffers import Interior
from planners.optimisation.interior.costs import Hold
from planners.optimisation.interior.descending import WEAKER, Drive, descend, fill
from planners.optimisation.interior.retiming import retimed
from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_in_steps, extra_steps
from planners.world.geometry.collision import Scene, blocked_states
from planners.world.goal import HEADING_TOLERANCE, HITCHES, RADIUS
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle

RANGE_M: Final = 0.3  # of obstacles, as of ``Barrier``
MOST_LAST: Final = 15  # iterations of each attempt to close gaps
MORE_STEPS: Final = (0, 1, 2, 4)  # than the time that was found
SHORT: Final = 0.9  # of a step of the vehicle: a drive whose steps are shorter is divided into fewer
ROUNDING: Final = 1e-6  # of a step


class Attempt(NamedTuple):
    """How softly a drive is held at first, so that it comes free; later all are held firmly."""

    tolerance: float  # share of what is tolerated at the goal that is aimed at
    strength: float  # of obstacles, and ...
    contact_m: float  # ... where they push hardest, as of ``Barrier``
    afresh: bool  # begins with the given drive again, not with what came of the attempt before


ATTEMPTS: Final = (  # one after another, until a drive is found
    Attempt(1.0, 0.01, 0.003, afresh=True),
    Attempt(0.5, 0.01, 0.003, afresh=False),
    Attempt(0.25, 0.01, 0.001, afresh=True),
    Attempt(0.25, 0.03, 0.001, afresh=True),
)


class Effort(NamedTuple):
    """What is done for a drive."""

    attempts: tuple[Attempt, ...]
    first: int  # iterations while time counts, for each division into steps
    divisions: int  # into steps, as long as these are short
    longer: tuple[float, ...]  # times the time that was found are tried when ``MORE_STEPS`` do not help
    most_blocked: float  # share of states while time counts: with more, closing gaps is mostly in vain


WHOLE: Final = Effort(ATTEMPTS, 60, 3, (1.07, 1.15, 1.3, 1.6), 1.0)
PROMISING: Final = 0.95  # of its time: what may get a drive below that is tried in all attempts
HURRIED: Final = 3.0  # no further way is tried once less is left than so many times what those so far took
FIRM_STRENGTH: Final = 0.003  # of obstacles in the end: less, so that they keep a drive off only ...
FIRM_CONTACT_M: Final = 0.00015  # ... close to them, but hard; both times ``WEAKER`` where it goes on
FIRM_INSIDE: Final = 0.15  # as of ``Hold``: nearly all that is tolerated at the goal is used ...
FIRM_PULL: Final = 30.0  # ... and no more


def _near(first: int) -> Effort:
    """What is done for a guess that is nearly optimal: more is mostly in vain."""
    return Effort(ATTEMPTS[:1], first, 1, (), 0.25)


def quickest(
    given: Sequence[Plan],
    model: Model,
    interior: Interior,
    goal: Floats,
    vehicle: Vehicle,
    scene: Scene,
    barrier: Barrier,
    iterations: int,
    until: float,
    below: int,
    extras: Sequence[int],
    *,
    near: int = 0,
) -> tuple[int, Plan | None, int]:
    """Find the quickest drive near the way of another one, or the cheapest near those of several.

    Args:
        given: drives, or guesses whose steps need not lead from state to state. They may be blocked, and all
            begin at the same state.
        model: buffers with room for as many steps and some more.
        interior: buffers of the same size.
        goal: that of ``goal_of``.
        vehicle: what is driven.
        scene: what must not be met.
        barrier: its margin and hitch count.
        iterations: at most, for each way.
        until: when to end, by ``working_clock``.
        below: only a drive that costs less steps is wanted.
        extras: what each costs beside its time, in steps.
        near: 0, or for guesses that are nearly optimal how many iterations each may take while time counts:
            then it begins with their speeds, and there is one attempt.

    Returns:
        The number of the one to which it belongs, a free drive that arrives as asked, if one was found, and
        the iterations used.
    """
    firm = barrier._replace(strength=FIRM_STRENGTH, range_m=RANGE_M, contact=FIRM_CONTACT_M)
    close = firm._replace(strength=WEAKER * FIRM_STRENGTH, contact=WEAKER * FIRM_CONTACT_M)
    soft, hold = Hold(firm, USUAL, 1.0), Hold(firm, FIRM_INSIDE, FIRM_PULL)
    drive = Drive(model, interior, goal, goal, scene, circles_around(scene), soft, (hold,), until)
    most = iterations * len(given)
    if near > 0:
        number, best, used = _found(given, drive, vehicle, _near(near), most, below, extras)
    else:
        guesses = [retimed(plan.states, vehicle) for plan in given]
        number, best, used = _found(guesses, drive, vehicle, WHOLE, most, below, extras)
    drive = drive._replace(firm=(hold, hold._replace(barrier=close)))
    while best is not None and used < most and working_clock() < until:
        again, extra = [retimed(best.states, vehicle)], [extra_steps(best, vehicle)]
        below = cost_in_steps(best, vehicle)
        _, quicker, more = _found(again, drive, vehicle, WHOLE, most - used, below, extra)
        used += more
        if quicker is None:
            break
        best = quicker
    return number, best, used


def _found(
    given: Sequence[Plan],
    around: Drive,
    vehicle: Vehicle,
    effort: Effort,
    most: int,
    cheaper_than: int,
    extras: Sequence[int],
) -> tuple[int, Plan | None, int]:
    """As ``quickest``, near ``given`` drives, in some attempts and ``most`` iterations in all.

    Only a drive that costs less than ``cheaper_than`` steps will do, and after one attempt it has to promise
    much less.
    """
    model = around.model
    room = len(model.controls) - MORE_STEPS[-1]
    guesses = {k: guess for k, guess in enumerate(given) if 0 < len(guess.controls) <= room}
    used = 0
    number, best, below = -1, None, cheaper_than

    def cost_s(k: int, guess: Plan) -> float:
        return guess.duration_s + extras[k] * vehicle.dt

    for attempt in effort.attempts:
        barrier = around.soft.barrier._replace(strength=attempt.strength, contact=attempt.contact_m)
        drive = around._replace(
            goal=_drawn_in(around.asked, attempt.tolerance), soft=around.soft._replace(barrier=barrier)
        )
        began, quickened = working_clock(), {}
        for k in sorted(guesses, key=lambda k: cost_s(k, guesses[k])):
            guess = given[k] if attempt.afresh else guesses[k]
            quicker, spent = _quickened(drive, guess, given[k].states[0], vehicle, effort, most - used)
            used += spent
            if blocked_states(quicker.states, vehicle, drive.scene).mean() > effort.most_blocked:
                continue
            quickened[k] = quicker
            now = working_clock()
            if drive.until - now < HURRIED * (now - began):
                break
        left = {}
        costs = {k: cost_s(k, guess) for k, guess in quickened.items()}
        for k in sorted(quickened, key=lambda k: costs[k]):
            found, spent = _in_whole_steps(
                drive, quickened[k], vehicle, effort, below - extras[k], most - used
            )
            used += spent
            if found is not None and (cost := cost_in_steps(found, vehicle)) < below:
                number, best, below = k, found, cost
            else:
                left[k] = quickened[k]
        promising = PROMISING * cheaper_than * vehicle.dt
        most_s = promising if best is None else (below - 1) * vehicle.dt
        guesses = {k: guess for k, guess in left.items() if costs[k] < most_s}
        if not guesses or used >= most or working_clock() > drive.until:
            break
    return number, best, used


def _quickened(
    drive: Drive, guess: Plan, start: Floats, vehicle: Vehicle, effort: Effort, most: int
) -> tuple[Plan, int]:
    """Change a guess while time counts, until its steps are hardly shorter than the vehicle's.

    Obstacles keep off by what is driven in a step, and speeds change by step: what fits between obstacles in
    half steps does not in whole ones. Returns the iterations used, too.
    """
    used = 0
    for division in range(effort.divisions):
        if division > 0:
            guess = resampled(guess, _whole_steps(guess.duration_s, vehicle))
        steps = len(guess.controls)
        fill(drive, guess, start)
        iterations = min(effort.first, most - used)
        dt, spent, _ = descend(drive, steps, vehicle._replace(dt=guess.dt), True, iterations)
        used += spent
        model = drive.model
        guess = Plan(model.states[: steps + 1].copy(), model.controls[:steps].copy(), dt)
        if dt > SHORT * vehicle.dt or used >= most:
            break
    return guess, used


def _whole_steps(seconds: float, vehicle: Vehicle) -> int:
    return max(math.ceil(seconds / vehicle.dt - ROUNDING), 1)


def _drawn_in(goal: Floats, share: float) -> Floats:
    """The goal with so much of its tolerances of place, heading and hitches."""
    aim = goal.copy()
    aim[[RADIUS, HEADING_TOLERANCE]] *= share
    aim[HITCHES + 1 :: 2] *= share
    return aim


def _in_whole_steps(
    drive: Drive, guess: Plan, vehicle: Vehicle, effort: Effort, below: int, iterations: int
) -> tuple[Plan | None, int]:
    """Divide a guess into less than ``below`` steps of the vehicle's length and close its gaps.

    Few steps more are tried at first, then many: what cannot be driven at full speed can more slowly. Returns
    a drive, if there is one, and the iterations used.
    """
    used = 0
    few = [_whole_steps(guess.duration_s, vehicle) + more for more in MORE_STEPS]
    many = [_whole_steps(share * guess.duration_s, vehicle) for share in effort.longer]
    for steps in (*few, *(each for each in many if each > few[-1])):
        if min(len(drive.model.controls), below - 1) < steps or used >= iterations:
            break
        if working_clock() > drive.until:
            break
        fill(drive, resampled(guess, steps), guess.states[0])
        _, spent, found = descend(drive, steps, vehicle, False, min(MOST_LAST, iterations - used))
        used += spent
        if found is not None:
            return found, used
    return None, used
