"""Drives that tests of the optimisation begin with, and vehicles of other kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.world.arrays import Floats
from planners.world.problem import Arrival, Plan, Problem, start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle
from tests.planners.world.motions import KINDS
from tests.worlds import problem_of

TRAIN = KINDS["car-first-order-2-trailers"]._replace(trailers=CAR_1_TRAILER.trailers)
FIRST_ORDER: dict[str, Vehicle] = {
    "car": KINDS["car-first-order"],
    "unicycle": KINDS["unicycle-first-order"],
    "train": TRAIN,
}
MORE: dict[str, Vehicle] = FIRST_ORDER | {"differential-drive": DIFFERENTIAL_DRIVE}


def driven(controls: Floats, *obstacles: np.ndarray, vehicle: Vehicle = CAR) -> tuple[Problem, Plan]:
    """A drive from the middle of the map, and the problem to arrive where it ends, at rest."""
    empty = replace(problem_of(list(obstacles)), start=(25.0, 25.0, 0.0))
    states = simulate(start_state(empty, vehicle), controls, vehicle)
    arrival = Arrival(float(states[-1, 2]), 0.05, 0.0, 0.0)
    problem = replace(empty, goal=(states[-1, 0], states[-1, 1]), goal_radius=0.1, arrival=arrival)
    return problem, Plan(states, controls)


def manoeuvre(turns: int) -> Floats:
    """Forwards, stop, wheels turned at rest, backwards, stop, and forwards again."""
    steer = [(0.0, 1.4)] * turns
    ahead, back = [(1.5, 0.0)] * 8 + [(-1.5, 0.0)] * 8, [(-1.0, 0.0)] * 6 + [(1.0, 0.0)] * 6
    away = [(0.0, -1.4)] * (2 * turns)
    return np.array([*steer, *ahead, *away, *back, *steer, *ahead])
