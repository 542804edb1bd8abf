"""What a drive costs: its seconds, and what the vehicle counts for driving in a gear and for changing it.

Plans are compared by this. Unless a vehicle's file says otherwise it is the driving time.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.jit import inlined
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, Costs, Vehicle

STANDING: Final = 1e-6  # m/s, below which a vehicle stands


@inlined
def cost_of_second(gear: float, vehicle: Vehicle) -> float:
    """What a second in a gear counts as: above 0 forwards, below 0 backwards; standing it is one."""
    if gear > 0.0:
        return vehicle.costs.forwards
    return vehicle.costs.backwards if gear < 0.0 else 1.0


@inlined
def pays(vehicle: Vehicle) -> bool:
    """Whether a drive may cost more than its time; searches need not count what costs nothing."""
    costs = vehicle.costs
    return costs.gear_change > 0.0 or costs.forwards > 1.0 or costs.backwards > 1.0


@inlined
def gear_of(metres: float) -> float:
    """The gear (1 or -1) of what is driven: of metres, or a speed (m/s), negative backwards."""
    return 1.0 if metres > 0.0 else -1.0


@inlined
def gear_after(gear: float, speed: float) -> float:
    """The gear (1 or -1) after a step that ends at this speed (m/s): the one before if it stands then."""
    if abs(speed) < STANDING:
        return gear
    return gear_of(speed)


@inlined
def extra_cost(before: float, gear: float, seconds: float, vehicle: Vehicle) -> float:
    """What some seconds in a gear cost beside these, with the change to it from the one before, if any."""
    change = vehicle.costs.gear_change if before * gear < 0.0 else 0.0
    return change + seconds * (cost_of_second(gear, vehicle) - 1.0)


@inlined
def extra_along(states: Floats, gear: float, vehicle: Vehicle) -> float:
    """What a drive over ``states [T, S]`` costs beside its time, if the vehicle was in this gear before."""
    extra = 0.0
    for i in range(1, states.shape[0]):
        before = gear
        gear = gear_after(before, states[i, 3])
        extra += extra_cost(before, gear, vehicle.dt, vehicle)
    return extra


def gears_of(plan: Plan, vehicle: Vehicle = CAR) -> Integers:
    """Whether each step ``[T - 1]`` of ``plan`` leads forwards (1) or backwards (-1).

    A step in which ``vehicle`` stands counts to the gear before, or to the first one that follows.
    """
    gears = _signs(plan, vehicle)
    moving = np.flatnonzero(gears)
    if len(moving) == 0:
        return np.ones_like(gears)
    last = np.searchsorted(moving, np.arange(len(gears)), side="right") - 1
    return gears[moving[np.maximum(last, 0)]]


def cusps_of(plan: Plan, vehicle: Vehicle = CAR) -> Integers:
    """The rows of the states at which ``vehicle`` changes gear on ``plan``."""
    return (np.flatnonzero(np.diff(gears_of(plan, vehicle))) + 1).astype(np.int32)


class Run(NamedTuple):
    """A part of a plan in one gear."""

    first: int  # row of its first state
    last: int  # row of its last state, the first of the next run
    gear: int  # 1 or -1


def runs_of(plan: Plan, vehicle: Vehicle = CAR) -> list[Run]:
    """The parts of ``plan`` between changes of gear, in order; none of a plan that is one state."""
    gears = gears_of(plan, vehicle).tolist()
    ends = [0, *cusps_of(plan, vehicle).tolist(), len(gears)] if gears else []
    return [Run(first, last, gears[first]) for first, last in pairwise(ends)]


def metres_backwards(plan: Plan, vehicle: Vehicle) -> float:
    """How far a plan leads backwards."""
    return float(np.hypot(*np.diff(plan.states[:, :2], axis=0).T)[gears_of(plan, vehicle) < 0].sum())


def cost_of(plan: Plan, vehicle: Vehicle) -> float:
    """What it costs ``vehicle`` to drive a ``plan``, in seconds."""
    costs = vehicle.costs
    if costs == Costs():
        return plan.duration_s
    signs = _signs(plan, vehicle)
    seconds = np.array([costs.backwards, 1.0, costs.forwards])[signs + 1].sum() * plan.dt
    return float(seconds + costs.gear_change * len(cusps_of(plan, vehicle)))


def extra_steps(plan: Plan, vehicle: Vehicle) -> int:
    """What a plan costs beside its time, in steps of the vehicle."""
    return round((cost_of(plan, vehicle) - plan.duration_s) / vehicle.dt)


def cost_in_steps(plan: Plan, vehicle: Vehicle) -> int:
    """What a plan costs, in steps of the vehicle."""
    return len(plan.controls) + extra_steps(plan, vehicle)


def _signs(plan: Plan, vehicle: Vehicle) -> Integers:
    """Whether each step leads forwards (1), backwards (-1) or stands (0)."""
    speeds = plan.states[1:, 3] if vehicle.first_order else 0.5 * (plan.states[:-1, 3] + plan.states[1:, 3])
    return np.sign(np.where(np.abs(speeds) < STANDING, 0.0, speeds)).astype(np.int32)
