"""Changes all states and controls of a drive at once, again and again, to save time or to close its gaps."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.optimisation.interior.buffers import Interior, accept_change, begin_inside
from planners.optimisation.interior.costs import Hold, present_cost, try_change
from planners.optimisation.interior.drivable import driven
from planners.optimisation.interior.newton import direction
from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene
from planners.world.problem import Plan
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


class Drive(NamedTuple):
    """What stays the same while a drive is optimised."""

    model: Model
    interior: Interior
    goal: Floats  # that is aimed at
    asked: Floats  # and that has to be reached
    scene: Scene
    circles: Floats
    soft: Hold  # at first
    firm: tuple[Hold, ...]  # one after another when little is left to gain; the first while gaps are closed
    until: float  # of the clock


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
    model, interior = drive.model, drive.interior
    # each begins with less strength than the one before, so that of closing gaps comes twice
    hold, *later = (drive.soft, *drive.firm) if time_counts else (drive.firm[0], drive.firm[0])
    around = drive.scene, drive.circles
    counts = 1.0 if time_counts else 0.0
    strength = FIRST_STRENGTH if time_counts else LAST_STEPS_STRENGTH
    damping, price, in_vain = FIRST_DAMPING, 1.0, 0
    tried, cost, cost_tried, gaps_tried = vehicle, math.nan, math.inf, math.inf
    begin_inside(model, interior, steps, strength, vehicle)
    for iteration in range(iterations):
        if working_clock() > drive.until:
            return vehicle.dt, iteration, None
        if math.isnan(cost):  # not known yet
            cost = present_cost(
                *(model, interior, steps, drive.goal, strength, counts, vehicle, *around, hold)
            )
        longer = vehicle._replace(dt=vehicle.dt * (1.0 + LITTLE_LONGER))
        damping, longer_s, share, slope, gaps, dearest = direction(
            *(model, interior, steps, drive.goal, strength, counts, damping, vehicle, longer, *around, hold)
        )
        price = max(min(price, 10.0 * dearest), dearest)
        gained = False
        for _ in range(TRIES):
            if share == 0.0:
                break
            tried = vehicle._replace(dt=vehicle.dt + share * longer_s)
            cost_tried, gaps_tried = try_change(
                *(model, interior, steps, share, drive.goal, strength, counts, tried, *around, hold)
            )
            expected = 1e-4 * share * min(slope - price * gaps, 0.0)
            if cost_tried + price * gaps_tried <= cost + price * gaps + expected + 1e-9:
                gained = True
                break
            share *= 0.5
        if not gained:
            in_vain += 1
            damping = 10.0 * max(damping, LEAST_DAMPING)
            if in_vain == IN_VAIN:
                return vehicle.dt, iteration + 1, None
            continue
        in_vain = 0
        vehicle, cost = tried, cost_tried
        accept_change(model, interior, steps, strength, vehicle)
        if not time_counts and gaps_tried < SMALL_GAPS:
            found = _driven(drive, steps, vehicle)
            if found is not None or (gaps_tried < NO_GAPS and abs(slope) < NO_GAIN):
                return vehicle.dt, iteration + 1, found
        if share > 0.5:
            damping = max(0.25 * damping, LEAST_DAMPING)
        elif share < 0.1:
            damping = min(3.0 * damping, MOST_DAMPING)
        little = LITTLE_S * vehicle.max_speed + 10.0 * strength
        if share > 0.3 and abs(slope) < little and gaps_tried < 1e-3 * steps * vehicle.dt:
            if later:
                strength, hold, cost = WEAKER * strength, later.pop(0), math.nan
            elif time_counts and gaps_tried < SMALL_GAPS:
                return vehicle.dt, iteration + 1, None
    return vehicle.dt, iterations, None if time_counts else _driven(drive, steps, vehicle)


def _driven(drive: Drive, steps: int, vehicle: Vehicle) -> Plan | None:
    """The drive that the controls in ``drive.model`` lead to, if it is free and arrives as asked."""
    model = drive.model
    return driven(model, steps, drive.asked, vehicle, drive.scene)
