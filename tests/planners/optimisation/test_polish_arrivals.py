"""A plan that must arrive at a pose is polished into a plan that still does, and is never longer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from planners.maps.questions import question_in
from planners.optimisation import polish as polish_module
from planners.optimisation.interior import descending as descending_module
from planners.optimisation.interior import quickest as quickest_module
from planners.optimisation.optimise import optimise
from planners.optimisation.polish import Polished, polish, polish_quickest
from planners.search.anytime import asking_for_kinds, improve
from planners.search.query import Limits, Query, usual_limits
from planners.search.registry import PLANNERS, plan
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Arrival, Plan, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from planners.world.view import View
from planners.world.workspace import Workspace
from tests.planners.clock import ticks
from tests.planners.world.strategies import seeds
from tests.worlds import box, problem_of

WORKSPACE = Workspace()
EVERY = {**VEHICLES, "car-first-order": CAR._replace(first_order=True)}


def polished(problem: Problem, found: Plan, vehicle: Vehicle = CAR, most: int | None = None) -> Polished:
    return polish(problem, found, vehicle, scene_of(problem), WORKSPACE, most)


def asked_and_answered(seed: int, vehicle: Vehicle = CAR) -> tuple[Problem, Plan] | None:
    world = problem_class(CLASSES[seed % len(CLASSES)], vehicle=vehicle).draw(seed, 0)
    asked = question_in(world, 0, seed, vehicle, pose=True)
    if asked is None:
        return None
    canonical, _ = to_canonical(asked)
    limits = Limits(expansions=2_000)
    found = plan("lattice", canonical, generator(seed), vehicle=vehicle, workspace=WORKSPACE, limits=limits)
    return None if found.plan is None else (canonical, found.plan)


def driven(controls: list[tuple[float, float]], arrival: Arrival | None = None, radius: float = 0.1) -> tuple:
    """A plan on open ground from the middle of the map, and the problem to arrive where it ends, at rest."""
    empty = replace(problem_of([]), start=(25.0, 25.0, 0.0))
    made = np.array(controls)
    states = simulate(start_state(empty), made, CAR)
    arrival = arrival or Arrival(float(states[-1, 2]), 0.05, 0.0, 0.0)
    problem = replace(empty, goal=(states[-1, 0], states[-1, 1]), goal_radius=radius, arrival=arrival)
    given_plan = Plan(states, made)
    assert faults(problem, given_plan) == []
    return problem, given_plan


def assert_arrives(problem: Problem, answer: Plan | None, vehicle: Vehicle = CAR) -> Plan:
    assert answer is not None
    assert faults(problem, answer, vehicle) == []
    assert count_free_prefix(answer.states, vehicle, scene_of(problem)) == len(answer.states)
    return answer


def cusps(states: Floats) -> int:
    gears = np.sign(states[np.abs(states[:, 3]) > 1e-6, 3])
    return int(np.count_nonzero(np.diff(gears)))


@given(
    speed=st.floats(0.5, 4.0),
    metres=st.floats(0.0, 3.0),
    radius=st.sampled_from([0.5, 2.0, 5.0]),
    speeds=st.tuples(st.floats(-1.0, 4.0), st.floats(-1.0, 4.0)),
)
def test_who_has_to_brake_hard_brakes_no_harder_than_it_can(
    speed: float, metres: float, radius: float, speeds: tuple[float, float]
) -> None:
    arrival = Arrival(None, 0.0, min(speeds), max(speeds))
    begun = replace(problem_of([]), start=(25.0, 25.0, 0.0), start_motion=(speed,), arrival=arrival)
    problem = replace(begun, goal=(25.0 + metres, 25.0), goal_radius=radius)
    found = plan("lattice", problem, generator(0), workspace=WORKSPACE, limits=Limits(expansions=500)).plan
    assume(found is not None)
    assert found is not None
    assert_arrives(problem, polished(problem, found).plan or found)


@pytest.mark.parametrize(
    "name",  # what two trailers need is compiled for this test alone: half a minute
    [pytest.param(name, marks=[pytest.mark.slow] * (name == "car-2-trailers")) for name in EVERY],
)
@settings(max_examples=5)
@given(seed=seeds)
def test_it_is_never_longer_and_arrives_as_asked(name: str, seed: int) -> None:
    vehicle = EVERY[name]
    both = asked_and_answered(seed, vehicle)
    assume(both is not None)
    assert both is not None
    problem, found = both
    better = assert_arrives(problem, polished(problem, found, vehicle).plan, vehicle)
    assert better.duration_s <= found.duration_s


def test_needless_stops_melt_away() -> None:
    forwards, brakes, waits = [(2.0, 0.0)] * 10, [(-2.0, 0.0)] * 10, [(0.0, 0.0)] * 15
    turns = [(0.0, 1.6), (0.0, 1.6)]
    problem, found = driven([*forwards, *brakes, *turns, *waits, *forwards, *brakes, *waits])
    better = assert_arrives(problem, polished(problem, found).plan)
    assert better.duration_s <= 0.55 * found.duration_s
    assert (better.states[1:-1, 3] > 0.0).all()


def test_a_cusp_that_is_needed_stays() -> None:
    left, right = [(2.0, 1.6)] * 4, [(-2.0, -1.6)] * 4
    back = [(-2.0, -1.6)] * 4 + [(0.0, 0.0)] * 8 + [(2.0, 0.0)] * 4
    problem, found = driven([*left, *[(0.0, 0.0)] * 10, *right, *back])
    assert cusps(found.states) == 1
    better = assert_arrives(problem, polished(problem, found).plan)
    assert better.duration_s <= found.duration_s
    assert cusps(better.states) == 1


@pytest.mark.parametrize("speeds", [(1.0, 2.0), (-0.5, -0.5), (0.0, math.inf)])
def test_the_speed_at_the_end_is_one_that_is_asked(speeds: tuple[float, float]) -> None:
    drive = [(2.0, 0.1)] * 8 + [(0.0, -0.1)] * 20
    if speeds[0] < 0.0:
        drive = [(2.0, 0.1)] * 8 + [(-2.0, -0.1)] * 8 + [(-0.5, 0.0)] * 10
    problem, found = driven(drive, Arrival(None, 0.0, *speeds), radius=1.5)
    better = assert_arrives(problem, polished(problem, found).plan)
    assert speeds[0] - 1e-9 <= better.states[-1, 3] <= speeds[1] + 1e-9
    assert better.duration_s < found.duration_s


def test_a_blocked_plan_is_freed_and_one_that_misses_arrives() -> None:
    along = [(2.0, 0.0)] * 15 + [(0.0, 0.0)] * 20 + [(-2.0, 0.0)] * 15
    problem, found = driven(along)
    start_x, y = problem.start[:2]
    beside = problem_of([box(start_x + 5.0, y + 0.6, 0.0, 0.5, 0.3)])
    blocked = replace(problem, obstacles=beside.obstacles)
    assert faults(blocked, found) != []
    assert_arrives(blocked, polished(blocked, found).plan)
    missed = replace(problem, goal=(problem.goal[0], problem.goal[1] + 0.4))
    assert_arrives(missed, polished(missed, found).plan)


def test_what_cannot_be_reached_gives_no_plan() -> None:
    problem, found = driven([(2.0, 0.0)] * 5 + [(-2.0, 0.0)] * 5)
    walled = replace(problem, obstacles=problem_of([box(*problem.goal, 0.0, 3.0, 3.0)]).obstacles)
    assert polished(walled, found).plan is None


def test_no_number_of_iterations_makes_it_longer_and_the_same_gives_the_same() -> None:
    both = next(each for seed in range(9) if (each := asked_and_answered(seed)) is not None)
    spent = [polished(*both, most=most) for most in (0, 1, 8, 60, 60)]
    durations = [assert_arrives(both[0], each.plan).duration_s for each in spent]
    assert durations == sorted(durations, reverse=True)
    assert durations[0] == both[1].duration_s
    assert all(each.iterations <= most for each, most in zip(spent, (0, 1, 8, 60, 60), strict=True))
    again = polish(*both, CAR, scene_of(both[0]), Workspace(), 60).plan
    assert again is not None
    assert spent[-1].plan is not None
    np.testing.assert_array_equal(again.controls, spent[-1].plan.controls)


def test_it_is_nearly_as_quick_as_what_ipopt_finds() -> None:
    answered = [each for seed in (502, 503, 516) if (each := asked_and_answered(seed)) is not None]
    exact = [optimise(*each).plan for each in answered]
    times = [
        (assert_arrives(each[0], polished(*each).plan).duration_s, theirs.duration_s)
        for each, theirs in zip(answered, exact, strict=True)
        if theirs is not None
    ]
    ours, theirs = np.mean(times, axis=0)
    assert ours <= 1.1 * theirs


def test_improvement_profits() -> None:
    both = next(each for seed in range(9) if (each := asked_and_answered(seed)) is not None)
    result = improve("lattice", both[0], both[1], expansions=12_000)
    assert result.plan is not None
    assert assert_arrives(both[0], result.plan).duration_s < both[1].duration_s


def test_in_a_hurry_one_of_several_drives_is_polished_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    slot = to_canonical(family("perpendicular", "standard", CAR).draw(45, 0))[0]
    view = View(slot, WORKSPACE)
    rng = generator(1, "search", slot.id, "lattice")
    asked = Query(slot, rng, view.scene, WORKSPACE, limits=usual_limits(slot))
    found = PLANNERS["lattice"](asking_for_kinds("lattice", asked))
    drives = sorted((other.plan for other in found.others), key=lambda drive: drive.duration_s)
    assert len(drives) > 1

    def polished_within(plans: list[Plan], seconds: float) -> tuple[Polished, float]:
        clock = ticks(1.0)  # a few iterations of a polish, then it reads the clock
        for module in (polish_module, quickest_module, descending_module):
            monkeypatch.setattr(module, "working_clock", clock)
        around = slot, plans, CAR, view.scene, WORKSPACE
        return polish_quickest(*around, seconds=seconds)[1], clock()

    alone, ticked = polished_within(drives[:1], 1e9)
    assert alone.plan is not None
    assert alone.plan.duration_s < 0.8 * drives[0].duration_s
    hurried, _ = polished_within(drives, ticked)
    assert hurried.plan is not None
    assert hurried.plan.duration_s == pytest.approx(alone.plan.duration_s, rel=0.1)
