"""With trailers a tree out of the start and one out of the goal meet: yards are turned round in."""

from __future__ import annotations

import numpy as np

from planners.search.outcome import Outcome
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR_1_TRAILER
from planners.world.workspace import Workspace

YARDS = [to_canonical(family("yard", "standard", CAR_1_TRAILER).draw(3, number))[0] for number in range(4)]


def turned_round(problem: Problem, workspace: Workspace) -> Outcome:
    limits = Limits(expansions=6000)
    return plan("lattice", problem, generator(0), limits=limits, vehicle=CAR_1_TRAILER, workspace=workspace)


def test_trains_turn_round_whatever_was_asked_before() -> None:
    used = Workspace()
    for yard in YARDS:
        found = turned_round(yard, used).plan
        again = turned_round(yard, Workspace()).plan
        assert found is not None
        assert again is not None
        assert faults(yard, found, CAR_1_TRAILER) == []
        assert np.array_equal(found.states, again.states)
