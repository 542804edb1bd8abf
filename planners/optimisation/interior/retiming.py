"""A guess for an optimisation: the way of a drive, as quickly as speeds and accelerations allow."""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import bend_of, control_limits, top_speed
from planners.world.vehicles.vehicle import Vehicle

STANDING_M: Final = 1e-6  # a step that is shorter stands still
SPEED_SHARE: Final = 0.98  # of full speed
ACCELERATION_SHARE: Final = 0.95  # of the largest acceleration
FINE: Final = 200  # pieces of a run for which its time is summed up
SHARES: Final = np.linspace(0.0, 1.0, FINE + 1)
LEAST_STEPS: Final = 2  # of a run


def retimed(states: Floats, vehicle: Vehicle) -> Plan:
    """The way of ``states [T, S]`` without standing still, as a plan whose controls do not quite fit.

    Each run in one gear begins and ends at rest, but for the speeds at the drive's ends. The wheels are where
    the drive had them at each place, even if they cannot turn so quickly.
    """
    metres = np.hypot(*np.diff(states[:, :2], axis=0).T)
    moving = np.flatnonzero(metres > STANDING_M)
    backwards = states[moving, 3] + states[moving + 1, 3] < 0.0
    first, last = abs(states[0, 3]), abs(states[-1, 3])
    guess = [states[:1]]
    starts = [0, *(np.flatnonzero(np.diff(backwards)) + 1), len(moving)]
    for begin, end in itertools.pairwise(starts):
        if begin == end:
            continue
        steps = moving[begin:end]
        way = np.concatenate([states[steps[:1]], states[steps + 1]])
        speeds = first if begin == 0 else 0.0, last if end == len(moving) else 0.0
        guess.append(_run(way, metres[steps], bool(backwards[begin]), speeds, vehicle))
    found = np.concatenate(guess)
    limits = np.array(control_limits(vehicle))
    controls = np.clip(np.diff(found[:, 3:5], axis=0) / vehicle.dt, -limits, limits)
    return Plan(found, controls, vehicle.dt)


def _run(
    way: Floats, metres: Floats, backwards: bool, speeds: tuple[float, float], vehicle: Vehicle
) -> Floats:
    """The states of a run after its first; ``speeds`` at its ends in m/s, not negative."""
    top = SPEED_SHARE * (-vehicle.min_speed if backwards else vehicle.max_speed)
    acceleration = ACCELERATION_SHARE * control_limits(vehicle)[0]
    along = np.concatenate([[0.0], np.cumsum(metres)])
    at = along[-1] * SHARES
    reached = np.sqrt(speeds[0] ** 2 + 2.0 * acceleration * at)
    left = np.sqrt(speeds[1] ** 2 + 2.0 * acceleration * (along[-1] - at))
    speed = np.minimum(np.minimum(reached, left), top)
    if math.isfinite(vehicle.max_lateral_acceleration):
        bends = np.interp(at, along, [bend_of(tuple(state), vehicle) for state in way])
        slow = SPEED_SHARE * np.array(
            [top_speed(-1.0 if backwards else 1.0, bend, vehicle) for bend in bends]
        )
        squares = slow**2 + 2.0 * acceleration * np.abs(at[:, np.newaxis] - at)
        speed = np.minimum(speed, np.sqrt(squares.min(axis=1)))
    seconds = np.concatenate([[0.0], np.cumsum(np.diff(at) / (0.5 * (speed[1:] + speed[:-1])))])
    steps = max(math.ceil(seconds[-1] / vehicle.dt), LEAST_STEPS)
    times = np.linspace(0.0, seconds[-1], steps + 1)[1:]
    places = np.interp(times, seconds, at)
    states = np.column_stack([np.interp(places, along, column) for column in way.T])
    states[:, 3] = np.interp(times, seconds, speed) * (-1.0 if backwards else 1.0)
    return states
