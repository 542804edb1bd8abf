"""What the vehicles' tests measure against: the equations as in docs/planners.md, integrated by SciPy."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from planners.world.arrays import Floats
from planners.world.vehicles.vehicle import CarWithTrailers, DifferentialDrive, Vehicle


def exact_motion(state: Floats, controls: Floats, times: Floats, vehicle: Vehicle) -> Floats:
    """States ``[len(times), S]`` at the given times, under constant controls ``[2]``."""

    def slopes(_: float, s: Floats) -> list[float]:
        heading, speed = s[2:4]
        turn = s[4] if isinstance(vehicle, DifferentialDrive) else speed * math.tan(s[4]) / vehicle.wheelbase
        rates = [speed * math.cos(heading), speed * math.sin(heading), turn, *controls]
        if isinstance(vehicle, CarWithTrailers):
            for hitch, length in zip(s[5:], vehicle.hitch_lengths, strict=True):
                trailing = speed * math.sin(hitch) / length
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
    hitches = len(vehicle.hitch_lengths) if isinstance(vehicle, CarWithTrailers) else 0
    fold = vehicle.max_hitch if isinstance(vehicle, CarWithTrailers) else 0.0
    most = turning_limits(vehicle)[0]
    return np.array([
        *rng.uniform(-5.0, 55.0, 2),
        rng.uniform(-math.pi, math.pi),
        often_at(rng, vehicle.min_speed, vehicle.max_speed),
        often_at(rng, -most, most),
        *(often_at(rng, -fold, fold) for _ in range(hitches)),
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
