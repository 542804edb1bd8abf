"""Changes all states and controls of a drive at once, again and again, to save time or to close its gaps."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.optimisation.interior.buffers import Interior, accept_change, begin_inside
from planners.optimisation.interior.costs import Hold, cost_of, try_change
from planners.optimisation.interior.drivable import is_drivable
from planners.optimisation.interior.newton import direction
from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene
from planners.world.jit import lean
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import with_step
from planners.world.vehicles.vehicle import Vehicle

FIRST_STRENGTH: Final = 3e-3  # metres, of the barrier at limits ...
WEAKER: Final = 0.1  # ... times this with each hold that follows when little is left to gain
LAST_STEPS_STRENGTH: Final = 1e-3  # while only gaps are closed
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-6, 1e3  # metres
TRIES: Final = 8  # shares of a change that are tried
IN_VAIN: Final = 5  # changes one after another after which there is no hope
LITTLE_S: Final = 0.05  # seconds to gain, with which a stage ends
SMALL_GAPS: Final = 1e-2  # their sum when the first part ends, metres and radians and more
NO_GAPS: Final = 1e-6  # their sum when the last part cannot close them better ...
NO_GAIN: Final = 1e-2  # ... if so little is left to gain, in metres
LITTLE_LONGER: Final = 1e-6  # share, for derivatives by the length of a step
SLICE: Final = 4  # iterations between two looks at the clock, where there is a limit

Holds = tuple[Hold, Hold, Hold]


class Drive(NamedTuple):
    """What stays the same while a drive is optimised."""

    model: Model
    interior: Interior
    goal: Floats  # that is aimed at
    asked: Floats  # and that has to be reached
    scene: Scene
    circles: Floats
    soft: Hold  # at first
    firm: tuple[Hold, ...]  # one or two, one after another when little is left to gain; the first closes gaps
    until: float  # of the clock


class Going(NamedTuple):
    """How far a descent is."""

    used: int  # iterations
    dt: float  # length of a step in seconds
    hold: int  # its number
    strength: float  # of the barrier at limits, in metres
    cost: float  # of the drive, not a number if it is not known
    damping: float = FIRST_DAMPING
    price: float = 1.0  # of a gap of 1
    in_vain: int = 0  # changes one after another that gained nothing
    ended: bool = False
    found: bool = False  # whether a drive lies in ``tried_states`` and ``tried_controls``


def fill(drive: Drive, guess: Plan, start: Floats) -> None:
    """Put a guess into the buffers of a drive, which begins at ``start [S]``."""
    drive.model.states[: len(guess.states)] = guess.states
    drive.model.states[0] = start
    drive.model.controls[: len(guess.controls)] = guess.controls


def descend(
    drive: Drive, steps: int, vehicle: Vehicle, time_counts: bool, iterations: int
) -> tuple[float, int, Plan | None]:
    """Change the drive in ``drive.model`` until little is left to gain, or it can be driven.

    Args:
        drive: what stays the same, and the buffers that ``fill`` filled.
        steps: of the drive.
        vehicle: what is driven, with the length of a step to begin with.
        time_counts: whether that length is free and counts; else only gaps are closed.
        iterations: at most.

    Returns:
        The length of a step, the iterations used, and a drive where time does not count and one is found.
    """
    model, firm = drive.model, drive.firm
    # each begins with less strength than the one before, so that of closing gaps comes twice
    holds = (drive.soft, firm[0], firm[-1]) if time_counts else (firm[0], firm[0], firm[0])
    last = len(firm) if time_counts else 1
    strength = FIRST_STRENGTH if time_counts else LAST_STEPS_STRENGTH
    going = Going(0, vehicle.dt, 0, strength, math.nan)
    at_once = iterations if math.isinf(drive.until) else SLICE
    while not going.ended and going.used < iterations and working_clock() <= drive.until:
        going = _descend_some(
            *(model, drive.interior, steps, drive.goal, drive.asked, holds, last),
            *(1.0 if time_counts else 0.0, vehicle, drive.scene, drive.circles, going, at_once, iterations),
        )
    if not going.found:
        return going.dt, going.used, None
    states, controls = model.tried_states[: steps + 1].copy(), model.tried_controls[:steps].copy()
    return going.dt, going.used, Plan(states, controls, going.dt)


@lean
def _descend_some(
    model: Model,
    interior: Interior,
    steps: int,
    goal: Floats,
    asked: Floats,
    holds: Holds,
    last: int,
    time_counts: float,
    given: Vehicle,
    scene: Scene,
    circles: Floats,
    going: Going,
    more: int,
    iterations: int,
) -> Going:
    """Go on for ``more`` iterations at most, up to ``iterations`` in all; ``last`` numbers the last hold."""
    used, dt, number, strength, cost, damping, price, in_vain, ended, found = going
    vehicle = with_step(given, dt)
    if used == 0:
        begin_inside(model, interior, steps, strength, vehicle)
    until = min(used + more, iterations)
    while used < until and not ended:
        used += 1
        hold = holds[number]
        if math.isnan(cost):
            cost = cost_of(
                *(model.states, model.controls, steps, goal, interior.aim, strength, time_counts),
                *(vehicle, scene, circles, hold),
            )
        longer = with_step(given, dt * (1.0 + LITTLE_LONGER))
        damping, longer_s, share, slope, gaps, dearest = direction(
            *(model, interior, steps, goal, strength, time_counts, damping, vehicle, longer),
            *(scene, circles, hold),
        )
        price = max(min(price, 10.0 * dearest), dearest)
        gained = False
        gaps_tried = math.inf
        for _ in range(TRIES):
            if share == 0.0:
                break
            tried_dt = dt + share * longer_s
            cost_tried, gaps_tried = try_change(
                *(model, interior, steps, share, goal, strength, time_counts, with_step(given, tried_dt)),
                *(scene, circles, hold),
            )
            expected = 1e-4 * share * min(slope - price * gaps, 0.0)
            if cost_tried + price * gaps_tried <= cost + price * gaps + expected + 1e-9:
                gained = True
                dt = tried_dt
                cost = cost_tried
                break
            share *= 0.5
        if not gained:
            in_vain += 1
            damping = 10.0 * max(damping, LEAST_DAMPING)
            ended = in_vain == IN_VAIN
            continue
        in_vain = 0
        vehicle = with_step(given, dt)
        accept_change(model, interior, steps, strength, vehicle)
        if time_counts == 0.0 and gaps_tried < SMALL_GAPS:
            found = is_drivable(model, steps, asked, vehicle, scene)
            if found or (gaps_tried < NO_GAPS and abs(slope) < NO_GAIN):
                ended = True
                continue
        if share > 0.5:
            damping = max(0.25 * damping, LEAST_DAMPING)
        elif share < 0.1:
            damping = min(3.0 * damping, MOST_DAMPING)
        little = LITTLE_S * vehicle.max_speed + 10.0 * strength
        if share > 0.3 and abs(slope) < little and gaps_tried < 1e-3 * steps * dt:
            if number < last:
                number += 1
                strength *= WEAKER
                cost = math.nan
            elif time_counts > 0.0 and gaps_tried < SMALL_GAPS:
                ended = True
    if used == iterations and time_counts == 0.0 and not ended:
        found = is_drivable(model, steps, asked, vehicle, scene)
        ended = True
    return Going(used, dt, number, strength, cost, damping, price, in_vain, ended, found)
