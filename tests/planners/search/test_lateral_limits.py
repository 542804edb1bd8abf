"""Every planner keeps to a limit of lateral acceleration, and the drives are hardly longer for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planners.optimisation.optimise import optimise
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle
from tests.worlds import box, problem_of

MOST = 1.0  # m/s^2; without a limit all of these reach several times as much


def limited(vehicle: Vehicle) -> Vehicle:
    return vehicle._replace(max_lateral_acceleration=MOST)


def driven(problem: Problem, planner: str, vehicle: Vehicle) -> Plan:
    """The plan that is returned, judged."""
    found = solve(problem, planner, seed=1, vehicle=vehicle).plan
    assert found is not None
    assert faults(problem, found, vehicle) == []
    return found


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE], ids=["car", "differential-drive"])
@pytest.mark.parametrize("planner", PLANNERS)
def test_no_plan_slides(planner: str, vehicle: Vehicle) -> None:
    slid = 0
    for name in CLASSES:
        problem = problem_class(name, vehicle=vehicle).draw(41, 0)
        driven(problem, planner, limited(vehicle))
        slid += faults(problem, driven(problem, planner, vehicle), limited(vehicle)) != []
    assert slid > 0


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE], ids=["car", "differential-drive"])
def test_a_turn_is_driven_as_fast_as_the_limit_allows(vehicle: Vehicle) -> None:
    """To a pose behind: no quicker than an arc at the limit, and not much more slowly than without one."""
    arrival = Arrival(heading=np.pi, heading_tolerance=0.1)
    problem = replace(
        problem_of([]), bounds=(-60.0, -60.0, 60.0, 60.0), start=(0.0, 0.0, 0.0), start_motion=(3.0,),
        goal=(0.0, 24.0), goal_radius=0.3, arrival=arrival,
    )  # fmt: skip
    slow, quick = (driven(problem, "lattice", each) for each in (limited(vehicle), vehicle))
    assert faults(problem, quick, limited(vehicle)) != []
    assert quick.duration_s < slow.duration_s < 1.4 * quick.duration_s
    turned = np.abs(np.diff(slow.states[:, 2])) / slow.dt * np.abs(slow.states[1:, 3])
    assert np.quantile(turned, 0.9) > 0.9 * MOST


def test_places_behind_bends_are_reached_about_as_quickly_as_the_bends_allow() -> None:
    """A trial of the lattice ended so soon that RRT answered, with drives three times as long."""
    quick = CAR._replace(max_speed=7.0, max_steering=0.5)
    took = []
    for most in (np.inf, 1.0):
        vehicle = quick._replace(max_lateral_acceleration=most)
        took.append(0.0)
        for seed in range(4):
            angle = 0.8 + 0.6 * seed
            goal = (30.0 * np.cos(angle), 30.0 * np.sin(angle))
            problem = replace(
                problem_of([]), bounds=(-60.0, -60.0, 60.0, 60.0), start=(0.0, 0.0, 0.0), goal=goal
            )
            took[-1] += driven(problem, "lattice", vehicle).duration_s
    assert took[1] < 1.45 * took[0]


def test_a_train_turns_round_within_its_limit() -> None:
    vehicle = limited(CAR_1_TRAILER)
    driven(family("yard", "standard", vehicle).draw(41, 0), "lattice", vehicle)


def test_a_robot_that_is_at_its_limit_goes_on_from_there() -> None:
    speed = 3.9
    steering = float(np.arctan(MOST * CAR.wheelbase / speed**2))
    problem = replace(
        problem_of([box(20.0, 0.0, 0.0, 2.0, 2.0)]), start_motion=(speed, steering * (1.0 - 1e-9))
    )
    driven(problem, "lattice", limited(CAR))


def test_ipopt_keeps_to_the_limit() -> None:
    problem = replace(problem_of([box(7.0, 5.0, 0.3, 1.0, 0.6)]), goal=(12.0, 12.0))
    guess = driven(problem, "lattice", limited(CAR))
    found = optimise(problem, guess, vehicle=limited(CAR)).plan
    assert found is not None
    assert faults(problem, found, limited(CAR)) == []
    assert found.duration_s <= guess.duration_s + CAR.dt
