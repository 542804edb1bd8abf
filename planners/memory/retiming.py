"""The way of one vehicle's plan, timed anew for another vehicle: a guess at how that one would drive it.

Each run between two changes of gear is driven as fast as the limits of speed, acceleration and steering rate
allow, and where the wheels must turn at rest there is time for it. Trailers follow: where the vehicle drives
backwards they are pulled along the run from its end, which is stable. The steps of the guess do not quite
lead from state to state, most of all where two runs meet; whatever uses it closes these gaps.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import lean
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import (
    bend_of,
    bend_rate,
    bend_with,
    control_limits,
    curvature_of,
    load,
    step,
    tightest_bend,
    top_speed,
    turn_in,
)
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle, state_size

STANDS: Final = 1e-6  # metres of a step: less is no drive
GENTLE: Final = 0.95  # of all limits: the rest is left for closing gaps


class Run(NamedTuple):
    """A part of a way in one gear."""

    gear: float  # 1 or -1
    metres: Floats  # [n] along the way, from 0 on
    poses: Floats  # [n, 3] x, y, heading
    bends: Floats  # [n] of the new vehicle's way, as ``bend_of``
    hitches: Floats  # [2, h] at its two ends: the old vehicle's, straight where the new one has more trailers


def retimed(plan: Plan, old: Vehicle, new: Vehicle, factor: float = 1.0) -> Floats:
    """Time a plan of the vehicle ``old`` anew for ``new``, with all lengths times ``factor``.

    Returns states ``[T, S]`` of ``new``. Turns on the spot are left out.
    """
    bends = np.empty(len(plan.states))
    _fill_bends(np.ascontiguousarray(plan.states), factor, old, new, bends)
    runs = _runs(plan, bends, factor, state_size(new))
    before = float(bends[0])
    first = abs(float(plan.states[0, 3])) if runs and plan.states[0, 3] * runs[0].gear > 0.0 else 0.0
    last = float(plan.states[-1, 3] != 0.0) * math.inf
    pieces = []
    for number, run in enumerate(runs):
        begin = factor * first if number == 0 else 0.0
        driven = _driven(run, new, begin, last if number == len(runs) - 1 else 0.0)
        if begin == 0.0:
            pieces.append(_steered_at_rest(driven[0], before, run.bends[0], new))
        pieces.append(driven)
        before = run.bends[-1]
    if not pieces:
        state = np.zeros((1, state_size(new)))
        state[0, :3] = plan.states[0, :3] * (factor, factor, 1.0)
        return state
    apart = [piece[:-1] for piece in pieces[:-1]]  # each begins where the one before ends
    return np.ascontiguousarray(np.concatenate([*apart, pieces[-1]]))


def _runs(plan: Plan, bends: Floats, factor: float, size: int) -> list[Run]:
    states = plan.states
    ways = np.hypot(*np.diff(states[:, :2], axis=0).T)
    gears = np.sign(states[1:, 3] + states[:-1, 3])
    moving = np.flatnonzero((ways >= STANDS) & (gears != 0.0))
    runs = []
    for part in np.split(moving, np.flatnonzero(np.diff(gears[moving])) + 1):
        if len(part) == 0:
            continue
        rows = np.concatenate((part[:1], part + 1))
        hitches = np.zeros((2, size - FIRST_HITCH))
        both = min(hitches.shape[1], states.shape[1] - FIRST_HITCH)
        hitches[:, :both] = states[rows[[0, -1]], FIRST_HITCH : FIRST_HITCH + both]
        runs.append(
            Run(
                float(gears[part[0]]),
                factor * np.concatenate(([0.0], np.cumsum(ways[part]))),
                states[rows, :3] * (factor, factor, 1.0),
                bends[rows],
                hitches,
            )
        )
    return runs


@lean
def _fill_bends(states: Floats, factor: float, old: Vehicle, new: Vehicle, bends: Floats) -> None:
    """Fill in the bends ``[T]`` with which ``new`` drives what ``old`` drives, as far as it can."""
    most = tightest_bend(0.0, new)
    for k in range(states.shape[0]):
        bend = bend_with(curvature_of(bend_of(load(states, k, old), old), old) / factor, new)
        bends[k] = min(max(bend, -most), most)


@lean
def _fill_turns(bends: Floats, vehicle: Vehicle, states: Floats) -> None:
    for k in range(states.shape[0]):
        states[k, 4] = turn_in(bends[k], states[k, 3], vehicle)


@lean
def _limits(fastest: float, vehicle: Vehicle) -> tuple[float, float]:
    """The largest acceleration, and how much a bend can change in a second at speeds up to ``fastest``."""
    return control_limits(vehicle)[0], bend_rate(fastest, vehicle)


def _driven(run: Run, vehicle: Vehicle, begin: float, end: float) -> Floats:
    """The states of a run that begins and ends with these speeds (m/s) at most."""
    fastest = vehicle.max_speed if run.gear > 0.0 else -vehicle.min_speed
    acceleration, rate = (GENTLE * each for each in _limits(fastest, vehicle))
    ways = np.diff(run.metres)
    tops = GENTLE * np.array([top_speed(run.gear, bend, vehicle) for bend in run.bends])
    slopes = np.abs(np.diff(run.bends)) / ways
    steered = rate / np.maximum(slopes, 1e-9)
    tops[1:] = np.minimum(tops[1:], steered)
    tops[:-1] = np.minimum(tops[:-1], steered)
    tops[0], tops[-1] = min(begin, fastest), min(tops[-1], end)
    for i, way in enumerate(ways):
        tops[i + 1] = min(tops[i + 1], math.sqrt(tops[i] ** 2 + 2.0 * acceleration * way))
    for i in range(len(ways) - 1, -1, -1):
        tops[i] = min(tops[i], math.sqrt(tops[i + 1] ** 2 + 2.0 * acceleration * ways[i]))
    paces = np.maximum(0.5 * (tops[1:] + tops[:-1]), 0.5 * np.sqrt(acceleration * ways))
    times = np.concatenate(([0.0], np.cumsum(ways / paces)))
    steps = max(math.ceil(times[-1] / vehicle.dt), 1)
    at = np.linspace(0.0, times[-1], steps + 1)
    states = np.empty((steps + 1, FIRST_HITCH + run.hitches.shape[1]))
    for c in range(3):
        states[:, c] = np.interp(at, times, run.poses[:, c])
    states[:, 3] = run.gear * np.interp(at, times, tops)
    _fill_turns(np.interp(at, times, run.bends), vehicle, states)
    _pull_trailers(states, run, vehicle)
    return states


def _pull_trailers(states: Floats, run: Run, vehicle: Vehicle) -> None:
    """Fill in the hitches: forwards from the beginning, and backwards from the end, as if time ran back."""
    size = states.shape[1]
    if size == FIRST_HITCH:
        return
    if run.gear > 0.0:
        states[0, FIRST_HITCH:] = run.hitches[0]
        _pull(states, vehicle)
        return
    back = states[::-1] * np.where(np.arange(size) == 3, -1.0, 1.0)
    back[0, FIRST_HITCH:] = run.hitches[1]
    _pull(back, vehicle)
    states[:, FIRST_HITCH:] = back[::-1, FIRST_HITCH:]


@lean
def _pull(states: Floats, vehicle: Vehicle) -> None:
    for k in range(states.shape[0] - 1):
        first = (states[k + 1, 3] - states[k, 3]) / vehicle.dt
        second = (states[k + 1, 4] - states[k, 4]) / vehicle.dt
        after = step(load(states, k, vehicle), first, second, vehicle)
        for h in range(FIRST_HITCH, states.shape[1]):
            states[k + 1, h] = after[h]


def _steered_at_rest(state: Floats, begin: float, end: float, vehicle: Vehicle) -> Floats:
    """The states in which the wheels are turned from one bend to another before a run."""
    steps = math.ceil(abs(end - begin) / (_limits(0.0, vehicle)[1] * vehicle.dt))
    states = np.repeat(state[None], steps + 1, axis=0)
    states[:, 3] = 0.0
    _fill_turns(np.linspace(begin, end, steps + 1), vehicle, states)
    return states
