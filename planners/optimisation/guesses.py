"""Where an optimisation may start: any states and controls, even if they cannot be driven."""

from __future__ import annotations

import math

import numpy as np

from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size


def straight_line(problem: Problem, vehicle: Vehicle = CAR) -> Plan:
    """Drive straight from start to goal through everything, with full acceleration up to full speed."""
    (x, y, _), (goal_x, goal_y) = problem.start, problem.goal
    distance = math.dist((x, y), problem.goal)
    gain = vehicle.max_acceleration * vehicle.dt
    speeds = [0.0]
    driven = [0.0]
    while driven[-1] < distance or len(driven) == 1:  # at least one step, on the spot too
        speeds.append(min(speeds[-1] + gain, vehicle.max_speed))
        driven.append(driven[-1] + 0.5 * vehicle.dt * (speeds[-2] + speeds[-1]))
    share = np.minimum(np.array(driven) / max(distance, 1e-9), 1.0)
    states = np.zeros((len(driven), state_size(vehicle)))
    states[:, 0] = x + share * (goal_x - x)
    states[:, 1] = y + share * (goal_y - y)
    states[:, 2] = math.atan2(goal_y - y, goal_x - x)
    states[:, 3] = speeds
    controls = np.zeros((len(driven) - 1, 2))
    controls[:, 0] = np.diff(speeds) / vehicle.dt
    return Plan(states, controls, vehicle.dt)


def resampled(guess: Plan, steps: int) -> Plan:
    """Divide the same motion into another number of steps, linearly interpolated, in the same time."""
    old = np.linspace(0.0, 1.0, len(guess.states))
    new = np.linspace(0.0, 1.0, steps + 1)
    states = np.column_stack([np.interp(new, old, column) for column in guess.states.T])
    middles = 0.5 * (old[1:] + old[:-1])
    controls = np.column_stack(
        [np.interp(0.5 * (new[1:] + new[:-1]), middles, column) for column in guess.controls.T]
    )
    return Plan(states, controls, guess.duration_s / steps)


def begun_at(guess: Plan, problem: Problem, vehicle: Vehicle = CAR) -> Plan:
    """Put the first state of a guess at the problem's start, and count its headings from there."""
    states = guess.states.copy()
    turns = round((problem.start[2] - states[0, 2]) / (2.0 * math.pi))
    states[:, 2] += 2.0 * math.pi * turns
    states[0] = start_state(problem, vehicle)
    return Plan(states, guess.controls, guess.dt)
