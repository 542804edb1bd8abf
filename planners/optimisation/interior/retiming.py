"""A guess for an optimisation: the way of a drive, as quickly as speeds and accelerations allow."""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import jit
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
    along = np.concatenate([[0.0], np.cumsum(metres)])
    tops = np.full(FINE + 1, SPEED_SHARE * (-vehicle.min_speed if backwards else vehicle.max_speed))
    if math.isfinite(vehicle.max_lateral_acceleration):
        bends = np.interp(along[-1] * SHARES, along, [bend_of(tuple(state), vehicle) for state in way])
        gear = -1.0 if backwards else 1.0
        tops = np.minimum(tops, SPEED_SHARE * np.array([top_speed(gear, bend, vehicle) for bend in bends]))
    tops[0], tops[-1] = min(tops[0], speeds[0]), min(tops[-1], speeds[1])
    acceleration = ACCELERATION_SHARE * control_limits(vehicle)[0]
    states = _timed(way, along, tops, acceleration, vehicle.dt)
    if backwards:
        states[:, 3] *= -1.0
    return states


@jit
def _timed(way: Floats, along: Floats, tops: Floats, acceleration: float, dt: float) -> Floats:
    """The states ``[K, S]`` after the first on a way, with forward speeds, as quickly as they can be driven.

    Args:
        way: ``[T, S]`` states.
        along: ``[T]`` where these are on the way, in metres.
        tops: ``[FINE + 1]`` the largest speeds at places equally far from each other, in m/s; changed here.
        acceleration: the largest, m/s^2.
        dt: length of a step in seconds, at most.
    """
    pieces = tops.shape[0] - 1
    piece = along[-1] / pieces
    more = 2.0 * acceleration * piece  # of the square of a speed, from one place to the next
    for i in range(pieces):
        tops[i + 1] = min(tops[i + 1], math.sqrt(tops[i] * tops[i] + more))
    for i in range(pieces - 1, -1, -1):
        tops[i] = min(tops[i], math.sqrt(tops[i + 1] * tops[i + 1] + more))
    whole = 0.0
    for i in range(pieces):
        whole += 2.0 * piece / (tops[i] + tops[i + 1])
    steps = max(math.ceil(whole / dt), LEAST_STEPS)
    states = np.empty((steps, way.shape[1]))
    i = 0  # the piece that is driven
    row = 0  # and the part of the way
    before = 0.0  # seconds until the piece begins
    takes = 2.0 * piece / (tops[0] + tops[1])
    for k in range(steps):
        seconds = whole * (k + 1) / steps
        while i < pieces - 1 and seconds > before + takes:
            before += takes
            i += 1
            takes = 2.0 * piece / (tops[i] + tops[i + 1])
        share = min((seconds - before) / takes, 1.0)
        place = (i + share) * piece
        while row < along.shape[0] - 2 and place > along[row + 1]:
            row += 1
        part = min((place - along[row]) / (along[row + 1] - along[row]), 1.0)
        for c in range(way.shape[1]):
            states[k, c] = way[row, c] + part * (way[row + 1, c] - way[row, c])
        states[k, 3] = tops[i] + share * (tops[i + 1] - tops[i])
    return states
