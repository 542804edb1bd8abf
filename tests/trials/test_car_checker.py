from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from planners.world.authority.authority import faults
from planners.world.problem import Arrival, Plan, Problem, obstacles_of
from planners.world.vehicles.vehicle import CAR
from tests.planners.world.authority.test_authority import EMPTY, good_plan, winding_plan
from tests.planners.world.motions import exact_motion
from tests.planners.world.strategies import box_corners, clutter, problem_with, seeds
from tests.trials.car_checker import corners, wrong_with
from tests.trials.checked_plans import car_plans
from tests.trials.judged_plans import canonical_plans

WIDE = (-100.0, -100.0, 100.0, 100.0)


def bent(plan: Plan, column: int, by: float) -> Plan:
    states = plan.states.copy()
    states[100:, column] += by
    return replace(plan, states=states)


def faster(plan: Plan, column: int, by: float) -> Plan:
    controls = plan.controls.copy()
    controls[100, column] += by
    return replace(plan, controls=controls)


def test_plans_of_every_planner_and_assist_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canonical_plans, "EXPERIENCES", 20)
    monkeypatch.setattr(canonical_plans, "SEEDS", 2)
    checked = [(source, wrong_with(problem, plan)) for problem, source, plan in islice(car_plans(94), 47)]
    assert {"searched", "repaired", "recalled"} <= {source for source, _ in checked}
    assert not [wrong for _, wrong in checked if wrong]


def test_what_arrives_as_asked_passes() -> None:
    end = good_plan().states[-1]
    asked = replace(EMPTY, arrival=Arrival(float(end[2]) + 20.0 * np.pi, 0.01, float(end[3]), float(end[3])))
    assert wrong_with(asked, good_plan()) == []


@pytest.mark.parametrize(
    ("fault", "problem", "plan"),
    [
        ("dynamics", EMPTY, bent(good_plan(), 0, 1e-5)),
        ("motion", EMPTY, bent(good_plan(), 1, 1e-3)),
        ("start", replace(EMPTY, start=(0.0, 0.1, EMPTY.start[2])), good_plan()),
        ("start", replace(EMPTY, start_motion=(1.0,)), good_plan()),
        ("arrival", replace(EMPTY, arrival=Arrival(EMPTY.start[2] + 1.0, 0.9)), good_plan()),
        ("arrival", replace(EMPTY, arrival=Arrival(least_speed=9.0)), good_plan()),
        ("goal", replace(EMPTY, goal=(50.0, 45.0)), good_plan()),
        ("speed", EMPTY, bent(good_plan(), 3, 0.1)),
        ("steering", EMPTY, bent(good_plan(), 4, 0.8)),
        ("acceleration", EMPTY, faster(good_plan(), 0, 2.1)),
        ("steering rate", EMPTY, faster(good_plan(), 1, -1.7)),
        ("time step", EMPTY, replace(good_plan(), dt=0.2)),
        ("bounds", replace(EMPTY, bounds=(-7.0, -7.0, 57.0, 50.0)), good_plan()),
        ("collision", problem_with(obstacles_of([[box_corners(20.0, 20.3, 0.0, 1e-3, 1e-3)]])), good_plan()),
    ],
)
def test_what_is_wrong_is_named(fault: str, problem: Problem, plan: Plan) -> None:
    assert fault in wrong_with(problem, plan)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_what_the_body_sweeps_between_two_states_is_checked(seed: int) -> None:
    """A splinter on the body's edge at any instant is met."""
    rng = np.random.default_rng(seed)
    plan = winding_plan(rng)
    step = int(rng.integers(len(plan.controls)))
    when = np.array([rng.uniform(0.0, plan.dt)])
    between = exact_motion(plan.states[step], plan.controls[step], when, CAR)
    edge = shapely.Polygon(corners(between)[0]).exterior.interpolate(rng.uniform(), normalized=True)
    splinter = box_corners(edge.x, edge.y, 0.0, 1e-6, 1e-6)
    assert "collision" in wrong_with(problem_with(obstacles_of([[splinter]]), WIDE), plan)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_what_the_authority_calls_free_shapely_calls_free(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = problem_with(clutter(rng, 8), WIDE)
    plan = winding_plan(rng)
    if not any(line.startswith("Collision") for line in faults(problem, plan)):
        assert "collision" not in wrong_with(problem, plan)
