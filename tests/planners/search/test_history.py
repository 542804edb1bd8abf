"""The same seed has the same answer, whatever the workspace was used for before."""

from __future__ import annotations

import pytest

from planners.search.manoeuvres.manoeuvring import allocate_trees
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.search.structures.frontier import SEARCH, allocate_frontier
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, state_size
from planners.world.workspace import Workspace
from tests.worlds import strewn

LIMITS = Limits(expansions=3000)
SLOTS = [to_canonical(family("parallel", "hard").draw(5, number))[0] for number in (2, 3, 9)]
STREWN = [strewn(number, 60) for number in range(2)]


def answer(planner: str, problem: Problem, workspace: Workspace) -> tuple[object, ...]:
    found = plan(planner, problem, generator(0), limits=LIMITS, workspace=workspace)
    states = None if found.plan is None else found.plan.states.tobytes()
    return found.status, found.expansions, found.collision_checks, found.nodes, states


@pytest.mark.parametrize("planner", PLANNERS)
def test_what_was_asked_before_changes_no_answer(planner: str) -> None:
    used = Workspace()
    answers = [[answer(planner, problem, used) for problem in STREWN] for _ in range(2)]
    assert answers[0] == answers[1] == [answer(planner, problem, Workspace()) for problem in STREWN]


def test_searches_long_ago_change_no_answer() -> None:
    used = Workspace()
    frontiers = [
        used.buffers(allocate_trees, state_size(CAR))[0].frontier,
        used.buffers(allocate_frontier),
    ]
    for problem in [*SLOTS, *STREWN]:
        fresh = answer("lattice", problem, Workspace())
        for searches in (1, 1 << 12, 1 << 20):
            later = [int(frontier.counts[SEARCH]) + searches for frontier in frontiers]
            assert answer("lattice", problem, used) == fresh
            for frontier, number in zip(frontiers, later, strict=True):
                frontier.counts[SEARCH] = max(number, int(frontier.counts[SEARCH]))
            assert answer("lattice", problem, used) == fresh
