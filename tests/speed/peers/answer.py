"""What a peer answers. OMPL keeps a control for many steps: its plans are driven again, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import jit
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.dynamics import admissible, load, simulate, step
from planners.world.vehicles.vehicle import Vehicle


class MissingError(Exception):
    """Something that a peer needs is not on this machine; the message says what, in one line."""


class Answer(NamedTuple):
    """One attempt of one planner."""

    plan: Plan | None
    seconds: float  # of its processor
    checks: int


@jit
def _reduced(start: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """The controls ``[T - 1, 2]`` that the vehicle admits of those that are given, from ``start [1, S]``."""
    result = np.empty_like(controls)
    state = load(start, 0, vehicle)
    for i in range(controls.shape[0]):
        first, second = admissible(state, controls[i, 0], controls[i, 1], vehicle)
        state = step(state, first, second, vehicle)
        result[i, 0] = first
        result[i, 1] = second
    return result


def replay(problem: Problem, runs: Sequence[Sequence[float]], vehicle: Vehicle) -> Plan:
    """The plan of ``runs`` (acceleration, steering rate, number of steps) from the problem's start."""
    start = start_state(problem, vehicle)
    flat = np.array(runs, float).reshape(-1, 3)
    given = np.repeat(flat[:, :2], flat[:, 2].astype(int), axis=0)
    controls = _reduced(start[np.newaxis], given, vehicle)
    return Plan(simulate(start, controls, vehicle), controls, vehicle.dt)
