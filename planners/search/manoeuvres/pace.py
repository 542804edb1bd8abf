"""Speeds over an arc from rest to rest where each place has a limit of its own."""

from __future__ import annotations

import math
from typing import Final

from planners.search.connection.profile import lower_to_brake
from planners.world.arrays import Floats
from planners.world.jit import inlined, lean

ROUNDING: Final = 1e-9
SLOWEST: Final = 0.5  # of what one step changes: what may not drive faster than that is about to arrive


@inlined
def _limit_at(way: float, limits: Floats, count: int, stride: float) -> float:
    """The limit at a place, between two of those that are known."""
    at = min(max(way / stride, 0.0), float(count))
    i = min(int(at), count - 1)
    return float(limits[i] + (at - i) * (limits[i + 1] - limits[i]))


@lean
def fill_pace(
    speeds: Floats, limits: Floats, count: int, metres: float, gear: float, acceleration: float, dt: float
) -> int:
    """Fill in speeds that lead exactly ``metres`` far, as quickly as limits of speed allow, nearly.

    The speeds are chosen step by step, so that they can be braked in time. What is missing at the end is
    driven as slowly as that place demands, which leaves all before it where it was.

    Args:
        speeds: ``[C]`` m/s, to fill in; negative backwards.
        limits: ``[count + 1]`` m/s, at places equally far from one another, the first and the last at the
            ends; lowered to what can be braked from.
        count: see ``limits``.
        metres: how far.
        gear: 1 forwards, -1 backwards.
        acceleration: the largest, in m/s^2.
        dt: seconds of a step.

    Returns:
        How many steps that takes; -1 if there is no room for them.
    """
    stride = metres / count
    lower_to_brake(limits, count, stride, acceleration)
    change = acceleration * dt
    spare = 0.125 * change * dt  # by which whole steps of braking may lead farther than one brake in between
    speeds[0] = 0.0
    speed = 0.0
    way = 0.0
    steps = 0
    most = speeds.shape[0] - 1
    while steps < most:
        room = metres - way - 0.5 * dt * speed - spare
        after = math.sqrt(max(0.25 * change * change + 2.0 * acceleration * room, 0.0)) - 0.5 * change
        if after < SLOWEST * change:
            break
        after = min(after, speed + change)
        for _ in range(2):
            after = min(after, _limit_at(way + 0.5 * dt * (speed + after), limits, count, stride))
        after = max(after, speed - change, 0.0)
        steps += 1
        speeds[steps] = after
        way += 0.5 * dt * (speed + after)
        speed = after
    while speed > 0.0 and steps < most:
        after = max(speed - change, 0.0)
        steps += 1
        speeds[steps] = after
        way += 0.5 * dt * (speed + after)
        speed = after
    if steps == 0:
        steps = 1  # from rest to rest, with what is missing in between
        speeds[1] = 0.0
    more = math.ceil((metres - way) / (dt * min(limits[count], change)) - ROUNDING)
    if steps + more > most or speed > 0.0:
        return -1
    if more > 0:
        slow = (metres - way) / (dt * more)
        at = steps
        while at > 0 and speeds[at] < slow:
            speeds[at + more] = speeds[at]
            at -= 1
        for i in range(at + 1, at + more + 1):
            speeds[i] = slow
        steps += more
    for i in range(steps + 1):
        speeds[i] *= gear
    return steps
