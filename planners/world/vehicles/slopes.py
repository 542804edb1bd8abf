"""How a step changes with the state before it and with its controls: derivatives of its equations.

The equations are those of ``car``, ``car_with_trailers`` and ``differential_drive``: speed and the fifth
variable are linear in time, and set the turn rate. What limits clamp is not seen here.
"""

from __future__ import annotations

from planners.world.arrays import Floats
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos
from planners.world.vehicles.car import directions_in
from planners.world.vehicles.car_with_trailers import (
    Three,
    after_rates,
    hitch_lengths,
    hitch_stages,
    hitches_of,
)
from planners.world.vehicles.dynamics import State, step, turn_rate
from planners.world.vehicles.vehicle import FIRST_HITCH, CarWithTrailers, Vehicle

Instant = tuple[float, float, float, float, float, float, float]  # speed; sine and cosine of each hitch


@inlined
def _pose_slope(
    directions: tuple[float, ...], h: float, speeds: Three, speed_slopes: Three, turn_slopes: Three
) -> Three:
    """How the pose after a step changes if speeds and turn rates do so at its beginning, middle and end."""
    sin_1, cos_1, sin_2, cos_2, sin_3, cos_3, sin_4, cos_4 = directions
    turn_2 = 0.5 * h * turn_slopes[0]
    turn_3 = 0.5 * h * turn_slopes[1]
    turn_4 = h * turn_slopes[1]
    x = speed_slopes[0] * cos_1 + 2.0 * speed_slopes[1] * (cos_2 + cos_3) + speed_slopes[2] * cos_4
    y = speed_slopes[0] * sin_1 + 2.0 * speed_slopes[1] * (sin_2 + sin_3) + speed_slopes[2] * sin_4
    x -= 2.0 * speeds[1] * (sin_2 * turn_2 + sin_3 * turn_3) + speeds[2] * sin_4 * turn_4
    y += 2.0 * speeds[1] * (cos_2 * turn_2 + cos_3 * turn_3) + speeds[2] * cos_4 * turn_4
    return h / 6.0 * x, h / 6.0 * y, h / 6.0 * (turn_slopes[0] + 4.0 * turn_slopes[1] + turn_slopes[2])


@inlined
def _instant(speed: float, hitches: Three) -> Instant:
    sin_1, cos_1 = sincos(hitches[0])
    sin_2, cos_2 = sincos(hitches[1])
    sin_3, cos_3 = sincos(hitches[2])
    return speed, sin_1, cos_1, sin_2, cos_2, sin_3, cos_3


@inlined
def _rate_slope(
    at: Instant, lengths: Three, speed_slope: float, turn_slope: float, hitch_slopes: Three
) -> Three:
    """How the rates of ``hitch_rates`` change if speed, turn rate and hitch angles do so."""
    speed, sin_1, cos_1, sin_2, cos_2, sin_3, cos_3 = at
    # of the speeds of the axles of the first two trailers
    along_1 = speed_slope * cos_1 - speed * sin_1 * hitch_slopes[0]
    along_2 = along_1 * cos_2 - speed * cos_1 * sin_2 * hitch_slopes[1]
    turn_1 = (speed_slope * sin_1 + speed * cos_1 * hitch_slopes[0]) / lengths[0]
    turn_2 = (along_1 * sin_2 + speed * cos_1 * cos_2 * hitch_slopes[1]) / lengths[1]
    turn_3 = (along_2 * sin_3 + speed * cos_1 * cos_2 * cos_3 * hitch_slopes[2]) / lengths[2]
    return turn_slope - turn_1, turn_1 - turn_2, turn_2 - turn_3


@lean
def _hitch_slope(
    instants: tuple[Instant, Instant, Instant, Instant],
    lengths: Three,
    h: float,
    speed_slopes: Three,
    turn_slopes: Three,
    hitch_slopes: Three,
) -> Three:
    """How the hitch angles after a step change if speeds, turn rates and the angles before it do so."""
    k = _rate_slope(instants[0], lengths, speed_slopes[0], turn_slopes[0], hitch_slopes)
    p = _rate_slope(
        instants[1], lengths, speed_slopes[1], turn_slopes[1], after_rates(hitch_slopes, 0.5 * h, k)
    )
    q = _rate_slope(
        instants[2], lengths, speed_slopes[1], turn_slopes[1], after_rates(hitch_slopes, 0.5 * h, p)
    )
    r = _rate_slope(instants[3], lengths, speed_slopes[2], turn_slopes[2], after_rates(hitch_slopes, h, q))
    return (
        hitch_slopes[0] + h / 6.0 * (k[0] + 2.0 * p[0] + 2.0 * q[0] + r[0]),
        hitch_slopes[1] + h / 6.0 * (k[1] + 2.0 * p[1] + 2.0 * q[1] + r[1]),
        hitch_slopes[2] + h / 6.0 * (k[2] + 2.0 * p[2] + 2.0 * q[2] + r[2]),
    )


@inlined
def _fill_hitch_slopes(
    state: State,
    speeds: Three,
    turns: Three,
    slopes: tuple[tuple[Three, Three], ...],
    vehicle: CarWithTrailers,
    by_state: Floats,
    by_control: Floats,
) -> None:
    """Fill in how the hitch angles change with all numbers but the pose."""
    h = vehicle.dt
    lengths = hitch_lengths(vehicle)
    hitches = hitches_of(state)
    k, p, q, _ = hitch_stages(h, speeds, turns, hitches, lengths)
    instants = (
        _instant(speeds[0], hitches),
        _instant(speeds[1], after_rates(hitches, 0.5 * h, k)),
        _instant(speeds[1], after_rates(hitches, 0.5 * h, p)),
        _instant(speeds[2], after_rates(hitches, h, q)),
    )
    unchanged = (0.0, 0.0, 0.0)
    trailers = len(state) - FIRST_HITCH
    for number in range(4):
        speed_slopes, turn_slopes = slopes[number]
        slope = _hitch_slope(instants, lengths, h, speed_slopes, turn_slopes, unchanged)
        for t in range(trailers):
            if number < 2:
                by_state[FIRST_HITCH + t, 3 + number] = slope[t]
            else:
                by_control[FIRST_HITCH + t, number - 2] = slope[t]
    for number in range(trailers):
        hitch_slopes = (
            1.0 if number == 0 else 0.0,
            1.0 if number == 1 else 0.0,
            1.0 if number == 2 else 0.0,
        )
        slope = _hitch_slope(instants, lengths, h, unchanged, unchanged, hitch_slopes)
        for t in range(trailers):
            by_state[FIRST_HITCH + t, FIRST_HITCH + number] = slope[t]


@inlined
def differentiate_step(
    state: State, first: float, second: float, vehicle: Vehicle, by_state: Floats, by_control: Floats
) -> State:
    """Fill in how the state after a step changes with the state before it and with the controls.

    Args:
        state: of S numbers, before the step.
        first: control, as of ``step``.
        second: control, as of ``step``.
        vehicle: what is driven.
        by_state: ``[S, S]``, a row for each number of the state after the step.
        by_control: ``[S, 2]``, the same.

    Returns:
        The state after the step.
    """
    h = vehicle.dt
    after = step(state, first, second, vehicle)
    shares = (h, h, h) if vehicle.first_order else (0.0, 0.5 * h, h)  # of the controls at the three instants
    speeds = (state[3] + shares[0] * first, state[3] + shares[1] * first, state[3] + shares[2] * first)
    turn_0, speed_0, fifth_0 = turn_rate(speeds[0], state[4] + shares[0] * second, vehicle)
    turn_1, speed_1, fifth_1 = turn_rate(speeds[1], state[4] + shares[1] * second, vehicle)
    turn_2, speed_2, fifth_2 = turn_rate(speeds[2], state[4] + shares[2] * second, vehicle)
    turns = (turn_0, turn_1, turn_2)
    directions = directions_in(state[2], turns, h)
    slopes = (  # of speeds and turn rates, by speed, fifth variable and both controls
        ((1.0, 1.0, 1.0), (speed_0, speed_1, speed_2)),
        ((0.0, 0.0, 0.0), (fifth_0, fifth_1, fifth_2)),
        (shares, (shares[0] * speed_0, shares[1] * speed_1, shares[2] * speed_2)),
        ((0.0, 0.0, 0.0), (shares[0] * fifth_0, shares[1] * fifth_1, shares[2] * fifth_2)),
    )
    size = len(state)
    for r in range(size):
        for c in range(size):
            by_state[r, c] = 1.0 if r == c else 0.0
        for c in range(2):
            by_control[r, c] = 0.0
    by_state[0, 2] = state[1] - after[1]  # the step turns with the heading
    by_state[1, 2] = after[0] - state[0]
    for number in range(4):
        slope = _pose_slope(directions, h, speeds, slopes[number][0], slopes[number][1])
        for r in range(3):
            if number < 2:
                by_state[r, 3 + number] = slope[r]
            else:
                by_control[r, number - 2] = slope[r]
    by_control[3, 0] = h
    by_control[4, 1] = h
    if len(state) > FIRST_HITCH:  # decided when compiling
        _fill_hitch_slopes(state, speeds, turns, slopes, vehicle, by_state, by_control)  # type: ignore[arg-type]  # only cars with trailers have so many
    return after
