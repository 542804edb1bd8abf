"""The independent judge of plans: own equations in NumPy, collision by FCL; shares no code with the planners.

What it accepts is a plan: driven by its controls from the problem's start, inside the vehicle's limits, to
the goal as it is asked for, the swept footprint of each of its bodies free and inside the bounds at every
instant.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from planners.world.arrays import Floats
from planners.world.authority.authority_equations import (
    limits_of,
    simulate_again,
    widest_hitches,
)
from planners.world.authority.authority_sweeps import sweep_faults
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.vehicle import (
    CAR,
    CarWithTrailers,
    DifferentialDrive,
    Vehicle,
    state_names,
    state_size,
)

TOLERANCE = 1e-6  # metres, radians, m/s: between the plan's states and its controls simulated again
BETWEEN = 0.01  # radians: how far a hitch may pass its limit between two states within it
ROUNDING = 1e-9  # on limits, metres and so on


def faults(problem: Problem, plan: Plan, vehicle: Vehicle = CAR) -> list[str]:
    """What is wrong with ``plan`` as an answer to ``problem``: one line each, none when it is good.

    The plan is in the frame and the lengths of the problem; lines tell real metres, where the problem lies.
    """
    states, controls = plan.states, plan.controls
    size = state_size(vehicle)
    if states.ndim != 2 or states.shape[1] != size or controls.shape != (len(states) - 1, 2):
        wanted = f"(T, {size}) and (T - 1, 2)"
        return [f"Shapes: states {states.shape}, controls {controls.shape}; wanted {wanted}."]
    if not (np.isfinite(states).all() and np.isfinite(controls).all()):
        return ["Numbers: the plan holds NaN or infinity."]
    found = []
    if plan.dt != vehicle.dt:
        found.append(f"Time step: {plan.dt} s; the vehicle's is {vehicle.dt} s.")
    still = [max(vehicle.min_speed, 0.0), *[0.0] * (size - 4)]  # as slow as it can be, and straight
    motion = [*problem.start_motion, *still[len(problem.start_motion) :]]
    off = np.abs(states[0] - [*problem.start, *motion])
    if off.max() > TOLERANCE:
        found.append(_start_fault(off, problem.scale, vehicle))
    beyond = _limit_faults(states, controls, problem.scale, vehicle)
    if not beyond and isinstance(vehicle, CarWithTrailers):
        widest = zip(widest_hitches(states, controls, vehicle), vehicle.trailers, strict=True)
        beyond = [
            f"Hitch {i}: {angle:.4g} rad between two states; allowed are {trailer.max_hitch:.4g} rad."
            for i, (angle, trailer) in enumerate(widest, start=1)
            if angle > trailer.max_hitch + BETWEEN
        ]
    if beyond:  # how far a step may bend is known within the limits only
        return found + beyond
    raw = (each.astype(np.float64).tobytes() for each in (states, controls))
    found += _dynamics_faults(*raw, problem.scale, vehicle)
    miss = math.dist(states[-1, :2], problem.goal)
    if miss > problem.goal_radius + ROUNDING:
        radius = problem.scale * problem.goal_radius
        found.append(
            f"Goal: the last state is {problem.scale * miss:.3f} m from it; allowed are {radius:g} m."
        )
    if problem.arrival is not None:
        found += _arrival_faults(states[-1].tolist(), problem.arrival, problem.scale, vehicle)
    return found + sweep_faults(problem, states, controls, vehicle)


def _start_fault(off: Floats, scale: float, vehicle: Vehicle) -> str:
    """By how much the first state is ``off [S]`` the start: the variable that is off by most."""
    return f"Start: {_worst(off, 0, scale, vehicle)} off the problem's start."


def _worst(off: Floats, number: int, scale: float, vehicle: Vehicle) -> str:
    """The variable of state ``number`` that is ``off [S]`` by most, and by how much."""
    worst = int(np.argmax(off))
    name = state_names(vehicle)[worst]
    unit = {"x": "m", "y": "m", "speed": "m/s", "turn_rate": "rad/s"}.get(name, "rad")
    value = off[worst] * (scale if unit.startswith("m") else 1.0)
    return f"{name} of state {number} is {value:.3g} {unit}"


def _arrival_faults(last: list[float], arrival: Arrival, scale: float, vehicle: Vehicle) -> list[str]:
    """What is wrong with heading, speed, turn rate and hitch angles of the ``last [S]`` state."""
    found = []
    if arrival.heading is not None:
        off = abs(math.remainder(last[2] - arrival.heading, math.tau))
        if off > arrival.heading_tolerance + TOLERANCE:
            allowed = arrival.heading_tolerance
            found.append(f"Heading: the last is {off:.3f} rad off the goal's; allowed are {allowed:.4g} rad.")
    low, high = arrival.least_speed, arrival.most_speed
    if not low - TOLERANCE <= last[3] <= high + TOLERANCE:
        asked_speeds = f"{scale * low:g} to {scale * high:g}"
        found.append(f"Arrival: the last speed is {scale * last[3]:.3g} m/s; asked are {asked_speeds} m/s.")
    has_turn_rate = isinstance(vehicle, DifferentialDrive) and not vehicle.first_order
    if has_turn_rate and (low, high) == (0.0, 0.0) and abs(last[4]) > TOLERANCE:
        found.append(f"Turn: the last turn rate is {last[4]:.3g} rad/s; at rest it is 0.")
    asked = zip(last[5:], arrival.hitches, arrival.hitch_tolerances, strict=bool(arrival.hitches))
    for number, (angle, wanted, allowed) in enumerate(asked, start=1):
        off = abs(angle - wanted)
        if off > allowed + TOLERANCE:
            found.append(
                f"Hitch {number}: the last is {off:.3f} rad off the goal's; allowed are {allowed:.4g} rad."
            )
    return found


def _limit_faults(states: Floats, controls: Floats, scale: float, vehicle: Vehicle) -> list[str]:
    found = []
    for name, values, low, high, unit in limits_of(states, controls, vehicle):
        if len(values) and (values.min() < low - ROUNDING or values.max() > high + ROUNDING):
            real = scale if unit.startswith("m") else 1.0
            told, allowed = (
                f"{real * least:.4g} to {real * most:.4g}"
                for least, most in ((values.min(), values.max()), (low, high))
            )
            found.append(f"{name}: {told} {unit}; allowed are {allowed}.")
    return found


@functools.lru_cache(maxsize=1_000)  # a stored plan is judged in many problems
def _dynamics_faults(states: bytes, controls: bytes, scale: float, vehicle: Vehicle) -> tuple[str, ...]:
    """The first state that is not where controls lead, of ``states [T, S]`` and ``controls [T - 1, 2]``."""
    claimed = np.frombuffer(states).reshape(-1, state_size(vehicle))
    led = simulate_again(claimed[0], np.frombuffer(controls).reshape(-1, 2), vehicle)
    off = np.abs(led - claimed)
    if off.max() <= TOLERANCE:
        return ()
    first = int(np.argmax(off.max(axis=1) > TOLERANCE))
    return (f"Dynamics: {_worst(off[first], first, scale, vehicle)} off where the controls lead.",)
