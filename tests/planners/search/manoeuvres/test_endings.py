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


def asked(problem: Problem, endings: Endings | None = None) -> Outcome:
    query = Query(problem, np.random.default_rng(0), scene_of(problem), WORKSPACE, limits=Limits(4000))
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


def test_a_vehicle_that_never_stood_knows_no_ending() -> None:
    states = np.zeros((3, 5))
    states[:, 3] = 1.0
    assert len(endings_of([(states, np.zeros((2, 2)))], CAR).follows) == 0
