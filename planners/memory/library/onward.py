"""Which stretches lead on best from a state: those after which the goal is nearest by time."""

from __future__ import annotations

from typing import Final, NamedTuple

from planners.memory.library.recalling import Cells
from planners.memory.library.stretches import MIDDLES, Stretches
from planners.memory.library.sub_plans import TURNS, speed_cell, turn_cell
from planners.search.structures.cost_to_go import metres_to_go
from planners.search.structures.time_to_go import Ahead, seconds_to_go
from planners.world.arrays import Floats, Integers
from planners.world.geometry.occupancy import is_crossed
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos
from planners.world.vehicles.dynamics import State
from planners.world.vehicles.vehicle import Vehicle

LISTED: Final = 24
GREED: Final = 1.1  # weight of the time to go
HEADING_S: Final = 0.5  # time to go for each unit of 1 - cos of the angle to turn by
LATE_S: Final = 1.0  # the same for each metre by which braking for the goal comes too late


class Ground(NamedTuple):
    """What is known of the ground between here and the goal."""

    cells: Cells
    ahead: Ahead


@inlined
def seconds_left(state: State, ground: Ground, vehicle: Vehicle) -> float:
    """The estimated driving time to the goal, in seconds."""
    return seconds_to_go(state, ground.ahead, HEADING_S, LATE_S, vehicle)


@lean
def list_stretches(
    stretches: Stretches,
    start: State,
    spent: float,
    within: float,
    ground: Ground,
    listed: Integers,
    estimates: Floats,
    vehicle: Vehicle,
) -> int:
    """List the best stretches that lead on from a state through free cells, and return how many.

    Args:
        stretches: to choose from.
        start: the state.
        spent: the time until there, in seconds.
        within: that of all the way, at most.
        ground: between there and the goal.
        listed: ``[LISTED]``, filled in with the best one first; of mirrored ones -1 - number.
        estimates: ``[LISTED]``, filled in with their estimates.
        vehicle: what is driven.
    """
    sin, cos = sincos(start[2])
    count = 0
    for mirrored in range(2):
        side = -1.0 if mirrored else 1.0
        cell = speed_cell(start[3], vehicle) * TURNS + turn_cell(side * start[4], vehicle)
        for k in range(stretches.cells[cell], stretches.cells[cell + 1]):
            along = stretches.ends[k, 0]
            across = side * stretches.ends[k, 1]
            x = start[0] + cos * along - sin * across
            y = start[1] + sin * along + cos * across
            then = spent + stretches.steps[k] * vehicle.dt
            least = then + GREED * metres_to_go(x, y, ground.ahead.go) / vehicle.max_speed
            if count == LISTED and least >= estimates[count - 1]:
                continue
            end = x, y, start[2] + side * stretches.ends[k, 2], stretches.ends[k, 3]
            left = seconds_left(end, ground, vehicle)
            estimate = then + GREED * left
            if then + left > within or (count == LISTED and estimate >= estimates[count - 1]):
                continue
            crossed = False
            for i in range(MIDDLES):
                along = stretches.middles[k, i, 0]
                across = side * stretches.middles[k, i, 1]
                x = start[0] + cos * along - sin * across
                y = start[1] + sin * along + cos * across
                crossed = is_crossed(x, y, ground.cells.occupied, ground.cells.window)
                if crossed:
                    break
            if crossed:
                continue
            at = min(count, LISTED - 1)
            while at > 0 and estimates[at - 1] > estimate:
                estimates[at] = estimates[at - 1]
                listed[at] = listed[at - 1]
                at -= 1
            estimates[at] = estimate
            listed[at] = -1 - k if mirrored else k
            count = min(count + 1, LISTED)
    return count
