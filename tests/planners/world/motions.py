"""What the vehicles' tests measure against: the equations as in docs/planners.md, integrated by SciPy."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from planners.world.arrays import Floats
from planners.world.authority.authority_equations import Body
from planners.world.vehicles.vehicle import (
    CAR,
    CAR_1_TRAILER,
    DIFFERENTIAL_DRIVE,
    VEHICLES,
    About,
    DifferentialDrive,
    Trailer,
    Vehicle,
    trailers_of,
)

PARTS = About(  # a body of two convex parts, neither of them a box
    b"parts",
    (
        ((-0.2, -0.3), (0.6, -0.45), (0.6, 0.45), (-0.2, 0.3)),
        ((0.6, -0.2), (1.8, 0.0), (0.6, 0.2)),
    ),
)
AT_ONCE = {"first_order": True, "max_acceleration": 50.0}  # the range of speeds in a step
KINDS: dict[str, Vehicle] = VEHICLES | {
    "car-first-order": CAR._replace(**AT_ONCE, max_steering_rate=20.0 * CAR.max_steering, about=PARTS),
    "unicycle-first-order": DIFFERENTIAL_DRIVE._replace(**AT_ONCE, max_turn_acceleration=40.0),
    "car-3-trailers": CAR_1_TRAILER._replace(
        trailers=(Trailer(), Trailer(1.5, 0.9, 0.4, 0.7, 0.9), Trailer(2.2, 1.2, 0.5, 0.8, 0.8)), about=PARTS
    ),
    "car-first-order-2-trailers": CAR_1_TRAILER._replace(
        **AT_ONCE, max_steering_rate=20.0 * CAR.max_steering, trailers=(Trailer(), Trailer())
    ),
}
SECOND_ORDER = {name: vehicle for name, vehicle in KINDS.items() if not vehicle.first_order}


def exact_motion(state: Floats, controls: Floats, times: Floats, vehicle: Vehicle) -> Floats:
    """States ``[len(times), S]`` at the given times, under constant controls ``[2]``, within a step."""
    rates_held = np.zeros(2) if vehicle.first_order else controls
    if vehicle.first_order:
        state = state.copy()
        state[3:5] += vehicle.dt * controls

    turns, hitched = isinstance(vehicle, DifferentialDrive), trailers_of(vehicle)

    def slopes(_: float, now: Floats) -> list[float]:
        s: list[float] = now.tolist()  # Python computes with its own numbers three times as fast
        heading, speed = s[2:4]
        turn = s[4] if turns else speed * math.tan(s[4]) / vehicle.wheelbase
        rates = [speed * math.cos(heading), speed * math.sin(heading), turn, *rates_held]
        for hitch, trailer in zip(s[5:], hitched, strict=True):
            trailing = speed * math.sin(hitch) / trailer.hitch_length
            rates.append(turn - trailing)
            turn, speed = trailing, speed * math.cos(hitch)
        return rates

    solved = solve_ivp(slopes, (0.0, times[-1]), state, "DOP853", times, rtol=1e-12, atol=1e-12)
    states: Floats = solved.y.T
    return states


def turning_limits(vehicle: Vehicle) -> tuple[float, float]:
    """Largest fifth variable (steering or turn rate) of a state, and largest second control."""
    if isinstance(vehicle, DifferentialDrive):
        return vehicle.max_turn_rate, vehicle.max_turn_acceleration
    return vehicle.max_steering, vehicle.max_steering_rate


def random_state(rng: np.random.Generator, vehicle: Vehicle) -> Floats:
    """A state ``[S]`` within the limits, often at them."""
    most = turning_limits(vehicle)[0]
    return np.array([
        *rng.uniform(-5.0, 55.0, 2),
        rng.uniform(-math.pi, math.pi),
        often_at(rng, vehicle.min_speed, vehicle.max_speed),
        often_at(rng, -most, most),
        *(often_at(rng, -each.max_hitch, each.max_hitch) for each in trailers_of(vehicle)),
    ])  # fmt: skip


def random_controls(rng: np.random.Generator, state: Floats, vehicle: Vehicle) -> Floats:
    """Controls ``[2]`` within the limits, often at them, that lead past no limit of speed or turning."""
    (most, change), h = turning_limits(vehicle), vehicle.dt
    acceleration = often_at(rng, -vehicle.max_acceleration, vehicle.max_acceleration)
    second = often_at(rng, -change, change)
    return np.array([
        np.clip(acceleration, (vehicle.min_speed - state[3]) / h, (vehicle.max_speed - state[3]) / h),
        np.clip(second, (-most - state[4]) / h, (most - state[4]) / h),
    ])  # fmt: skip


def often_at(rng: np.random.Generator, low: float, high: float) -> float:
    """A number from low to high, one time in three one of these."""
    return float(np.clip(rng.uniform(1.5 * low, 1.5 * high), low, high))


def gentle_controls(rng: np.random.Generator, steps: int, vehicle: Vehicle) -> Floats:
    """Controls ``[steps, 2]`` that drive a vehicle from rest to and fro without folding its trailers."""
    acceleration = np.full(steps, 0.0)
    acceleration[: round(2.0 / vehicle.dt)] = 1.0
    turning = np.repeat(rng.uniform(-0.15, 0.15, -(-steps // 20)), 10)
    turning = np.ravel(np.column_stack((turning.reshape(-1, 10), -turning.reshape(-1, 10))))[:steps]
    return np.column_stack((acceleration, turning))


def placed(body: Body) -> Floats:
    """The corners ``[T, n, 2]`` of a body at each state of its plan."""
    across = np.column_stack((-body.along[:, 1], body.along[:, 0]))
    corners: Floats = np.stack([body.centres + u * body.along + w * across for u, w in body.corners], axis=1)
    return corners
