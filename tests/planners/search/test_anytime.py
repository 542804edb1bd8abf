import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimisation.polish import Polished
from planners.search import anytime
from planners.search.anytime import improve
from planners.search.outcome import Outcome, Status
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR
from tests.planners.clock import ticks
from tests.worlds import problem_of, strewn, walled_goal

EVERY = pytest.mark.parametrize("name", PLANNERS)


@EVERY
@given(seed=st.integers(0, 10**6), count=st.integers(0, 40), beginning=st.booleans())
@settings(max_examples=6, deadline=None)
def test_every_plan_of_the_history_is_better_and_the_last_passes_the_authority(name, seed, count, beginning):
    problem = strewn(seed, count)
    known = plan("follow", problem, generator(seed)).plan if beginning else None
    result = improve(name, problem, known, expansions=2_000, seed=seed)
    durations = [each.duration_s for each in result.history]
    assert all(a > b for a, b in itertools.pairwise(durations))
    assert [each.expansions for each in result.history] == sorted(each.expansions for each in result.history)
    assert (result.plan is None) == (not result.history)
    if result.plan is not None:
        assert result.plan.duration_s == durations[-1]
        assert faults(problem, result.plan) == []
    if known is not None:
        assert durations[0] == known.duration_s
    assert result.expansions <= 2_000


def test_a_plan_that_is_polished_and_nothing_more_is_still_the_given_one():
    problem = strewn(4, 20)
    known = plan("follow", problem, generator(4)).plan
    polished = improve("gust", problem, known, expansions=anytime.EXPANSIONS_AN_ITERATION * 40)
    assert polished.plan.duration_s < known.duration_s
    assert polished.is_given
    assert not improve("lattice", problem, known, expansions=20_000).is_given
    assert not improve("gust", problem, expansions=5_000).is_given


@EVERY
def test_the_same_seed_improves_alike(name):
    first, again = (improve(name, strewn(3, 30), expansions=3_000, seed=4) for _ in range(2))
    np.testing.assert_array_equal(first.plan.states, again.plan.states)
    assert [each[1:] for each in first.history] == [each[1:] for each in again.history]


@EVERY
def test_a_first_plan_counts_before_it_is_polished(name):
    problem = strewn(1, 30)
    rng = generator(4, "improve", problem.id, name, 0)
    found = plan(name, problem, rng, limits=Limits(expansions=anytime.FIRST_EXPANSIONS))
    assert found.plan is not None
    first = improve(name, problem, expansions=3_000, seed=4).history[0]
    assert (first.expansions, first.duration_s) == (max(found.expansions, 1), found.plan.duration_s)


def test_a_vehicle_of_long_steps_is_improved_too():
    vehicle = CAR._replace(dt=0.5)
    found = improve("lattice", strewn(1, 10), expansions=1_500, vehicle=vehicle).plan
    assert found is None or faults(strewn(1, 10), found, vehicle) == []


def test_more_work_gives_shorter_drives():
    short, long = (improve("gust", strewn(1, 30), expansions=n).plan.duration_s for n in (1_000, 20_000))
    assert long < short


def test_a_limit_in_seconds_is_kept(monkeypatch):
    monkeypatch.setattr(anytime, "working_clock", ticks())
    result = improve("rrt", strewn(1, 30), seconds=0.2)
    assert 0.2 <= result.seconds < 0.25


@EVERY
def test_what_has_no_solution_ends_too(name):
    assert improve(name, walled_goal(), expansions=500).plan is None


def test_thousands_of_searches_in_vain_end_with_the_time(monkeypatch):
    asked = []

    def in_vain(query):
        asked.append(query.limits.expansions)
        return Outcome(Status.START_BLOCKED, None, 0, 0, 0, 0.0, 0.0)

    monkeypatch.setattr(anytime, "working_clock", ticks())
    monkeypatch.setitem(anytime.PLANNERS, "lattice", in_vain)
    assert improve("lattice", walled_goal(), seconds=20.0).plan is None
    assert len(asked) > 2_000
    assert asked == sorted(asked)
    assert asked[-1] == anytime.MOST_EXPANSIONS


def test_into_a_narrow_slot_longer_searches_find_a_quicker_drive():
    problem = to_canonical(family("perpendicular", "hard", CAR).draw(6, 10))[0]
    answer = solve(problem, "lattice").plan
    first, again = (improve("lattice", problem, answer, expansions=50_000) for _ in range(2))
    assert first.plan.duration_s < answer.duration_s
    assert not first.is_given
    assert faults(problem, first.plan) == []
    assert first.expansions <= 50_000
    np.testing.assert_array_equal(first.plan.controls, again.plan.controls)
    assert [each[1:] for each in first.history] == [each[1:] for each in again.history]


def test_each_search_of_a_narrow_place_is_longer_and_no_drive_is_polished_twice(monkeypatch):
    problem = to_canonical(family("perpendicular", "hard", CAR).draw(6, 10))[0]
    answer = solve(problem, "lattice").plan
    further, polished = [], []

    def search(query):
        further.append(query.limits.further)
        done = query.limits.further if len(further) < 4 else 10
        return Outcome(Status.SOLVED, answer, 0, done, 0, 0.0, 0.0)

    def polish(asked, plans, *_, **__):
        polished.extend(plans)
        return 0, Polished(None, 0)

    monkeypatch.setitem(anytime.PLANNERS, "lattice", search)
    monkeypatch.setattr(anytime, "polish_quickest", polish)
    improve("lattice", problem, expansions=20_000)
    # the fourth had nothing left to look for
    assert further[:6] == [anytime.FURTHER * 2**k for k in range(4)] + [0, 0]
    assert len(polished) == 1


def test_without_a_limit_nothing_is_begun():
    with pytest.raises(ValueError, match="give seconds or expansions"):
        improve("rrt", problem_of([]))


@EVERY
@pytest.mark.parametrize("limit", [{"expansions": 100_000}, {"seconds": 60.0}])
def test_who_is_there_already_is_done(name, limit):
    there = replace(problem_of([]), start=(20.0, 20.0, 0.0), goal=(20.5, 20.0))
    found = improve(name, there, **limit)
    assert found.plan is not None
    assert found.plan.duration_s == 0.0
    assert found.seconds < 30.0
