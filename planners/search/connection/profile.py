"""Speeds of a drive over a given distance, in whole steps: as quick as the limits allow, and exact."""

from __future__ import annotations

import math
from typing import Final

from planners.world.arrays import Floats
from planners.world.goal import SLACK
from planners.world.jit import inlined, lean

SOLVES: Final = 40  # most corrections of the cruising speed
EXACT: Final = 1e-9  # metres
HALF_A_MILLIMETRE: Final = 5e-4


@inlined
def run_seconds(metres: float, first: float, last: float, top: float, acceleration: float) -> float:
    """The least time for a distance between two speeds (m/s, not negative); infinite if it is too short."""
    if 2.0 * acceleration * metres < abs(first * first - last * last):
        return math.inf
    peak = math.sqrt(acceleration * metres + 0.5 * (first * first + last * last))
    if peak <= top:
        return (2.0 * peak - first - last) / acceleration
    changing = abs(top * top - first * first) + abs(top * top - last * last)
    rest = metres - changing / (2.0 * acceleration)
    return (abs(top - first) + abs(top - last)) / acceleration + rest / top


@inlined
def _speed(k: int, steps: int, first: float, last: float, cruising: float, change: float) -> float:
    """The speed after ``k`` of ``steps`` steps, near to ``cruising``; ``change`` is for a step at most."""
    least = max(max(first - k * change, last - (steps - k) * change), 0.0)
    most = min(first + k * change, last + (steps - k) * change)
    return max(least, min(cruising, most))


@inlined
def _ramp(speed: float, cruising: float, change: float) -> tuple[int, float]:
    """Steps between a speed and the cruising speed, and the sum of the speeds after them."""
    count = int(abs(cruising - speed) / change + 1e-9)
    toward = change if cruising > speed else -change
    return count, count * (speed + 0.5 * toward * (count + 1))


@inlined
def _distance(
    steps: int, first: float, last: float, cruising: float, change: float, dt: float
) -> tuple[float, int]:
    """How far some steps lead at a cruising speed that they reach, and how many of them cruise."""
    up, up_sum = _ramp(first, cruising, change)
    down, down_sum = _ramp(last, cruising, change)
    cruises = steps - 1 - up - down
    return dt * (0.5 * (first + last) + up_sum + down_sum + cruises * cruising), cruises


@inlined
def _fastest(steps: int, first: float, last: float, top: float, change: float) -> float:
    """The highest speed that some steps reach."""
    k = int(0.5 * (last - first + steps * change) / change)
    k = min(max(k, 0), steps - 1)
    here = min(first + k * change, last + (steps - k) * change)
    after = min(first + (k + 1) * change, last + (steps - k - 1) * change)
    return min(top, max(here, after))


@lean
def fill_run(
    speeds: Floats,
    at: int,
    metres: float,
    first: float,
    last: float,
    top: float,
    gear: float,
    acceleration: float,
    dt: float,
) -> int:
    """Fill in the speeds of a run in one gear, from ``speeds[at]`` on.

    Args:
        speeds: ``[C]`` m/s, negative backwards, at the ends of steps.
        at: where the run begins.
        metres: how far it leads.
        first: the speed at its beginning, not negative, in m/s.
        last: and at its end.
        top: the largest speed.
        gear: 1 forwards, -1 backwards.
        acceleration: the largest, in m/s^2.
        dt: seconds of a step.

    Returns:
        Where the run ends: the speed there is ``last``. -1 if the distance is too short, or room is missing.
    """
    seconds = run_seconds(metres, first, last, top, acceleration)
    if not seconds < dt * (speeds.shape[0] - 3 - at):
        return -1
    change = acceleration * dt
    steps = max(1, math.ceil(max(seconds, abs(last - first) / acceleration) / dt - 1e-9))
    cruising = _fastest(steps, first, last, top, change)
    far, cruises = _distance(steps, first, last, cruising, change, dt)
    while far < metres - EXACT:
        steps += 1
        if at + steps >= speeds.shape[0]:
            return -1
        cruising = _fastest(steps, first, last, top, change)
        far, cruises = _distance(steps, first, last, cruising, change, dt)
    low = 0.0
    high = cruising
    for _ in range(SOLVES):
        if abs(far - metres) < EXACT:
            break
        if far > metres:
            high = cruising
        else:
            low = cruising
        cruising -= (far - metres) / (dt * max(cruises, 1))
        if not low < cruising < high:
            cruising = 0.5 * (low + high)
        far, cruises = _distance(steps, first, last, cruising, change, dt)
    if abs(far - metres) > HALF_A_MILLIMETRE:
        return -1
    for k in range(steps + 1):
        speeds[at + k] = gear * _speed(k, steps, first, last, cruising, change)
    return at + steps


@inlined
def lower_to_brake(limits: Floats, count: int, stride: float, acceleration: float) -> None:
    """Lower ``limits [count + 1]`` (m/s), at places ``stride`` metres apart, to what can be braked from."""
    for i in range(count - 1, -1, -1):
        limits[i] = min(limits[i], math.sqrt(limits[i + 1] * limits[i + 1] + 2.0 * acceleration * stride))


@lean
def fill_limited(
    speeds: Floats,
    at: int,
    limits: Floats,
    count: int,
    metres: float,
    first: float,
    last: float,
    gear: float,
    acceleration: float,
    dt: float,
) -> int:
    """Fill in the speeds of a run where each place has a limit of its own; the rest as ``fill_run``.

    It leads about as far as asked: the caller corrects what is missing. ``limits [count + 1]`` in m/s are
    those of places equally far from one another, the first and the last at the ends; they are lowered to what
    is driven.
    """
    stride = metres / count
    limits[0] = first
    limits[count] = last
    lower_to_brake(limits, count, stride, acceleration)
    if limits[0] < first - SLACK:
        return -1
    seconds = 0.0
    for i in range(1, count + 1):
        limits[i] = min(limits[i], math.sqrt(limits[i - 1] * limits[i - 1] + 2.0 * acceleration * stride))
        seconds += 2.0 * stride / (limits[i - 1] + limits[i])
    if limits[count] < last - SLACK or not seconds < dt * (speeds.shape[0] - 2 - at):
        return -1
    steps = max(math.ceil(seconds / dt), 1)
    share = seconds / (steps * dt)
    speeds[at] = gear * first
    i = 0
    gone = 0.0
    cell = 2.0 * stride / (limits[0] + limits[1])
    for k in range(1, steps):
        time = k * dt * share
        while gone + cell < time and i < count - 1:
            gone += cell
            i += 1
            cell = 2.0 * stride / (limits[i] + limits[i + 1])
        within = min((time - gone) / cell, 1.0)
        speeds[at + k] = gear * share * (limits[i] + within * (limits[i + 1] - limits[i]))
    speeds[at + steps] = gear * last
    return at + steps
