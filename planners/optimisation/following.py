"""Drives along a plan from a state beside it: the time-varying linear-quadratic regulator.

Kalman (1960); Anderson and Moore, Optimal Control: Linear Quadratic Methods (1990). What is off the plan dies
away behind the start, also of trailers that are backed, at a cost of two sweeps over the plan.
"""

from __future__ import annotations

from planners.optimisation.descent import drive_changed
from planners.optimisation.gains import LastMotion
from planners.optimisation.local_model import Model, differentiate_steps
from planners.world.arrays import Floats
from planners.world.goal import LEAST_SPEED, MOST_SPEED, MOST_TURN, SLACK
from planners.world.jit import lean
from planners.world.vehicles.dynamics import control_limits, numbers_of
from planners.world.vehicles.vehicle import Vehicle


@lean
def follow(model: Model, steps: int, goal: Floats, full_control: float, vehicle: Vehicle) -> None:
    """Drive along a plan of ``steps`` steps, whose first state need not be on it.

    Args:
        model: ``states`` and ``controls`` hold the plan, but ``states[0]`` is where the vehicle is. The drive
            comes into ``tried_states`` and ``tried_controls``, with as many steps.
        steps: of the plan.
        goal: that of ``goal_of``; the last state moves as it asks, by controls beyond
            their limits if need be.
        full_control: what weighs as much as a full control, off the plan, in metres or radians.
        vehicle: what is driven.
    """
    size = numbers_of(model.states, vehicle)
    first_weight, second_weight = control_limits(vehicle)
    first_weight = (full_control / first_weight) ** 2
    second_weight = (full_control / second_weight) ** 2
    by_first, by_second, across_first, across_second = model.vectors[:4]
    costs, product = model.squares[0], model.squares[1]
    differentiate_steps(model, steps, vehicle)
    for r in range(size):
        for c in range(size):
            costs[r, c] = 1.0 if r == c else 0.0
    for k in range(steps - 1, -1, -1):
        a = model.by_state[k]
        b = model.by_control[k]
        first = first_weight
        both = 0.0
        second = second_weight
        for r in range(size):
            by_first[r] = 0.0
            by_second[r] = 0.0
            for j in range(size):
                by_first[r] += costs[r, j] * b[j, 0]
                by_second[r] += costs[r, j] * b[j, 1]
            for c in range(size):
                product[r, c] = 0.0
                for j in range(size):
                    product[r, c] += costs[r, j] * a[j, c]
            first += b[r, 0] * by_first[r]
            both += b[r, 0] * by_second[r]
            second += b[r, 1] * by_second[r]
        determinant = first * second - both * both
        feedback = model.feedback[k]
        for c in range(size):
            across_first[c] = 0.0
            across_second[c] = 0.0
            for j in range(size):
                across_first[c] += by_first[j] * a[j, c]
                across_second[c] += by_second[j] * a[j, c]
            feedback[0, c] = (both * across_second[c] - second * across_first[c]) / determinant
            feedback[1, c] = (both * across_first[c] - first * across_second[c]) / determinant
        for r in range(size):
            for c in range(size):
                value = across_first[r] * feedback[0, c] + across_second[r] * feedback[1, c]
                for j in range(size):
                    value += a[j, r] * product[j, c]
                costs[r, c] = value
        for r in range(size):
            for c in range(r):
                mean = 0.5 * (costs[r, c] + costs[c, r])
                costs[r, c] = mean
                costs[c, r] = mean
        for r in range(size):
            if r != 3 and r != 4:
                costs[r, r] += 1.0
    last = LastMotion(goal[LEAST_SPEED] + SLACK, goal[MOST_SPEED] - SLACK, max(goal[MOST_TURN] - SLACK, 0.0))
    drive_changed(model, steps, 0.0, last, vehicle)
