"""Buffers of an optimisation whose numbers stay strictly within their limits, and their multipliers.

Speed, steering (or turn rate) and both controls have limits. A logarithm of what is left to each limit keeps
them away from it, by less and less (Nocedal and Wright 2006, chapter 19).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.jit import inlined, lean
from planners.world.vehicles.dynamics import control_limits, numbers_of, turn_limit
from planners.world.vehicles.vehicle import Vehicle

LIMITED: Final = 4  # numbers of a step that have limits: both controls, then speed and steering after it
INSIDE: Final = 0.01  # share of its range that every number begins away from its limits, half at either side
FAR_OFF: Final = 1e3  # a multiplier is so many times off what the barrier alone makes it at most


class Interior(NamedTuple):
    """Buffers for a drive of at most C steps, besides those of ``Model``."""

    change: Floats  # [C + 1, S] of the states
    change_controls: Floats  # [C, 2]
    by_time: Floats  # [C, S] derivative of the next state by the length of a step
    control_by_time: Floats  # [C, 2] change of the controls for a change of that length
    multipliers: Floats  # [C, 2 LIMITED] of the lower and the upper limit of each number
    hessians: Floats  # [C + 1, S, S] of the cost to go
    gradients: Floats  # [C + 1, S]
    mixed: Floats  # [C + 1, S] by state and length of a step
    aim: Floats  # [S] what is asked that is next to the last state
    vectors: Floats  # [9, S] scratch
    squares: Floats  # [3, S, S] scratch


def allocate_interior(steps: int, size: int) -> Interior:
    """Buffers for drives of up to ``steps`` steps with states of ``size`` numbers."""
    shapes = (
        (steps + 1, size),
        (steps, 2),
        (steps, size),
        (steps, 2),
        (steps, 2 * LIMITED),
        (steps + 1, size, size),
        (steps + 1, size),
        (steps + 1, size),
        (size,),
        (9, size),
        (3, size, size),
    )
    return Interior(*(np.zeros(shape) for shape in shapes))


@inlined
def limits_of(number: int, vehicle: Vehicle) -> tuple[float, float]:
    """The least and the largest value of one of the ``LIMITED`` numbers."""
    first, second = control_limits(vehicle)
    if number == 0:
        return -first, first
    elif number == 1:
        return -second, second
    elif number == 2:
        return vehicle.min_speed, vehicle.max_speed
    else:
        turn = turn_limit(vehicle)
        return -turn, turn


@inlined
def value_of(states: Floats, controls: Floats, k: int, number: int) -> float:
    """One of the ``LIMITED`` numbers of step ``k``; of the changes of a drive, its change."""
    if number < 2:
        return float(controls[k, number])
    return float(states[k + 1, number + 1])


@lean
def begin_inside(model: Model, interior: Interior, steps: int, barrier: float, vehicle: Vehicle) -> None:
    """Move every number inside its limits, with the multipliers that belong to the ``barrier``."""
    for k in range(steps):
        for number in range(LIMITED):
            low, high = limits_of(number, vehicle)
            shy = 0.5 * INSIDE * (high - low)
            value = value_of(model.states, model.controls, k, number)
            value = min(max(value, low + shy), high - shy)
            if number < 2:
                model.controls[k, number] = value
            else:
                model.states[k + 1, number + 1] = value
            interior.multipliers[k, 2 * number] = barrier / (value - low)
            interior.multipliers[k, 2 * number + 1] = barrier / (high - value)


@lean
def accept_change(model: Model, interior: Interior, steps: int, strength: float, vehicle: Vehicle) -> None:
    """Take ``model.tried_states`` over, and change the multipliers by as much as keeps them positive."""
    share = 1.0
    for update in range(2):
        for k in range(steps):
            for number in range(LIMITED):
                low, high = limits_of(number, vehicle)
                value = value_of(model.states, model.controls, k, number)
                change = value_of(interior.change, interior.change_controls, k, number)
                for side in range(2):
                    left = value - low if side == 0 else high - value
                    less = -change if side == 0 else change
                    multiplier = interior.multipliers[k, 2 * number + side]
                    more = strength / left - multiplier + multiplier / left * less
                    if update == 1:
                        interior.multipliers[k, 2 * number + side] = multiplier + share * more
                    elif more < 0.0:
                        share = min(share, -0.99 * multiplier / more)
    for k in range(steps):
        for c in range(2):
            model.controls[k, c] = model.tried_controls[k, c]
        for c in range(numbers_of(model.states, vehicle)):
            model.states[k + 1, c] = model.tried_states[k + 1, c]
        for number in range(LIMITED):
            low, high = limits_of(number, vehicle)
            value = value_of(model.states, model.controls, k, number)
            for side in range(2):
                usual = strength / (value - low if side == 0 else high - value)
                multiplier = interior.multipliers[k, 2 * number + side]
                multiplier = min(max(multiplier, usual / FAR_OFF), usual * FAR_OFF)
                interior.multipliers[k, 2 * number + side] = multiplier
