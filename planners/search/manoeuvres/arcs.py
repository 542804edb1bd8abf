"""Arcs: ways at a constant bend, in one gear, along which a vehicle may stop anywhere."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.jit import inlined
from planners.world.trigonometry import sincos
from planners.world.vehicles.dynamics import State, step, store, top_speed, trailing, turn_in
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

STRIDE: Final = 0.02  # of the first body's length: from one look at obstacles to the next
LEAST: Final = 0.001  # of it: the stride of a vehicle that hardly moves in a step
COARSE: Final = 4.0  # strides of a step where nothing is looked at, or roughly
FINE_LOOKS: Final = 5  # so many looks where the way is narrow, each with a smaller margin
# a step along an arc: where it leads from the origin, and the speed (m/s) and fifth variable on it
Leap = tuple[float, float, float, float, float]


@inlined
def stride_of(gear: float, vehicle: Vehicle) -> float:
    """The metres from one look to the next: no more than are driven in a step at full speed.

    It is at least ``LEAST`` of the length, and 0 if the vehicle cannot drive in this gear. A vehicle that
    cannot stand drives whole steps at its least speed. Vehicles may be those that drive out of a goal.
    """
    least = max(vehicle.min_speed, -vehicle.max_speed)
    top = top_speed(gear, 0.0, vehicle)
    if top <= 0.0:
        return 0.0
    if least > 0.0:
        return least * vehicle.dt
    length = vehicle.front + vehicle.rear
    return float(min(STRIDE * length, max(top * vehicle.dt, LEAST * length)))


@inlined
def at_pace(state: State, speed: float, bend: float, vehicle: Vehicle) -> State:
    """The same pose, with a speed (m/s) and a bend."""
    return (state[0], state[1], state[2], speed, turn_in(bend, speed, vehicle), *state[FIRST_HITCH:])


class Stride(NamedTuple):
    """A stride of an arc: from one look at obstacles to the next."""

    metres: float
    whole: Leap
    fine: Leap  # ``FINE_LOOKS`` of them


@inlined
def leap_of(state: State, speed: float, bend: float, vehicle: Vehicle) -> Leap:
    """Where a step at a constant speed (m/s) and bend leads; any ``state`` will do."""
    origin = at_pace((0.0, 0.0, 0.0, *state[3:]), speed, bend, vehicle)
    after = step(origin, 0.0, 0.0, vehicle)
    return after[0], after[1], after[2], origin[3], origin[4]


@inlined
def stride_in(state: State, gear: float, bend: float, metres: float, vehicle: Vehicle) -> Stride:
    """The stride of so many ``metres``, at most ``stride_of``, in a gear (1 or -1); any ``state`` will do."""
    speed = gear * metres / vehicle.dt
    whole = leap_of(state, speed, bend, vehicle)
    return Stride(metres, whole, leap_of(state, speed / FINE_LOOKS, bend, vehicle))


@inlined
def leapt(state: State, leap: Leap, vehicle: Vehicle) -> State:
    """The state after a leap. Only the trailers are simulated: all else turns and moves with the state."""
    sin, cos = sincos(state[2])
    x = state[0] + cos * leap[0] - sin * leap[1]
    y = state[1] + sin * leap[0] + cos * leap[1]
    speed = min(max(leap[3], vehicle.min_speed), vehicle.max_speed)
    after = (x, y, state[2] + leap[2], speed, leap[4], *state[FIRST_HITCH:])
    return trailing(after, leap[3], leap[2] / vehicle.dt, vehicle)


@inlined
def stride_along(state: State, stride: Stride, vehicle: Vehicle, scene: Scene) -> tuple[State, float, int]:
    """Drive on for a stride of an arc, as far as it is free.

    Where a look with the margin of the whole stride finds no room, there are ``FINE_LOOKS`` short ones.

    Args:
        state: from where.
        stride: of the arc.
        vehicle: what is driven.
        scene: what must not be met.

    Returns:
        The last free state, how many metres were free, and how often obstacles were looked at.
    """
    metres = stride.metres
    after = leapt(state, stride.whole, vehicle)
    if state_is_free(after, vehicle, scene):
        return after, metres, 1
    for k in range(FINE_LOOKS):
        after = leapt(state, stride.fine, vehicle)
        if not state_is_free(after, vehicle, scene):
            return state, k * metres / FINE_LOOKS, k + 2
        state = after
    return state, metres, FINE_LOOKS + 1


@inlined
def lay_arc(
    way: Floats, at: int, state: State, gear: float, bend: float, metres: float, turn: float, vehicle: Vehicle
) -> int:
    """Lay an arc from a state into ``way`` from row ``at`` on; returns the next row, -1 without room."""
    count = max(math.ceil(metres / (COARSE * stride_of(gear, vehicle))), 1)
    if at + count >= way.shape[0]:
        return -1
    speed = gear * metres / (count * vehicle.dt)
    state = at_pace(state, speed, bend, vehicle)
    for i in range(count + 1):
        store(way, at + i, state)
        way[at + i, 2] += turn
        way[at + i, 3] = gear  # retimed later
        state = step(at_pace(state, speed, bend, vehicle), 0.0, 0.0, vehicle)
    return at + count + 1
