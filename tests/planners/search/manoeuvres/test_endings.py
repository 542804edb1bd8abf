"""Ends of plans that are known: they lead to the goal exactly, and spare a search its work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.search.manoeuvres.endings import endings_of
from planners.search.outcome import Outcome
from planners.search.query import Endings, Limits, Query
from planners.search.registry import PLANNERS
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace

WORKSPACE = Workspace()


def asked(problem: Problem, endings: Endings | None = None, most: int = 4000) -> Outcome:
    query = Query(problem, np.random.default_rng(0), scene_of(problem), WORKSPACE, limits=Limits(most))
    return PLANNERS["lattice"](replace(query, endings=endings))


def test_parts_end_where_the_next_begins() -> None:
    plan = asked(to_canonical(family("parallel").draw(4, 0))[0]).plan
    assert plan is not None
    endings = endings_of([(plan.states, plan.controls)], CAR)
    assert len(endings.follows) > 1
    for part, after in enumerate(endings.follows):
        first, last = endings.starts[part : part + 2]
        driven = simulate(endings.states[first].copy(), endings.controls[first : last - 1], CAR)
        wanted = endings.states[endings.starts[after]] if after >= 0 else np.zeros(3)
        assert np.allclose(driven[-1][:3], wanted[:3], atol=1e-9)


def test_known_endings_spare_expansions() -> None:
    drawn = family("parallel")
    plans = [asked(to_canonical(drawn.draw(4, number))[0]).plan for number in range(6)]
    endings = endings_of([(plan.states, plan.controls) for plan in plans if plan is not None], CAR)
    alone = with_endings = 0
    for number in range(20):
        problem = to_canonical(drawn.draw(5, number))[0]
        answer = asked(problem, endings)
        assert answer.plan is not None
        assert faults(problem, answer.plan) == []
        alone += asked(problem).expansions
        with_endings += answer.expansions
    assert with_endings < 0.75 * alone


def test_what_is_solved_alone_is_solved_with_known_endings_too() -> None:
    parallel, perpendicular = family("parallel"), family("perpendicular", "hard")
    slots = [to_canonical(perpendicular.draw(3, number))[0] for number in range(30)]
    known = [asked(to_canonical(parallel.draw(4, number))[0]).plan for number in range(4)]
    known += [asked(slot).plan for slot in slots[:6]]
    endings = endings_of([(plan.states, plan.controls) for plan in known if plan is not None], CAR)
    solved = 0
    for slot in slots[6:]:
        alone = asked(slot, most=150)
        solved += alone.plan is not None
        if alone.plan is not None:
            answer = asked(slot, endings, most=150).plan
            assert answer is not None
            assert faults(slot, answer) == []
    assert 0 < solved < len(slots[6:])  # some need all that they may have


def test_endings_that_do_not_fit_change_no_plan() -> None:
    slot = to_canonical(family("perpendicular", "hard").draw(3, 1))[0]
    through = np.zeros((41, 5))
    through[:, 0] = np.linspace(0.0, 6.0, 41)  # out to the front, where a wall is
    through[1:-1, 3] = 1.0
    endings = endings_of([(through[::-1].copy(), np.zeros((40, 2)))], CAR)
    assert len(endings.follows) == 1
    alone, answer = asked(slot).plan, asked(slot, endings).plan
    assert alone is not None
    assert answer is not None
    assert np.array_equal(alone.states, answer.states)


def test_a_vehicle_that_never_stood_knows_no_ending() -> None:
    states = np.zeros((3, 5))
    states[:, 3] = 1.0
    assert len(endings_of([(states, np.zeros((2, 2)))], CAR).follows) == 0
