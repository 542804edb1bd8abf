"""A search for manoeuvres with trailers does not stay where it gets nowhere."""

from __future__ import annotations

import pytest

from planners.search.manoeuvres.pose_tree import allocate_pose_tree, plant_root, region_of
from planners.search.query import Limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import CAR_1_TRAILER, state_size
from planners.world.workspace import Workspace

LENGTH = CAR_1_TRAILER.front + CAR_1_TRAILER.rear


@pytest.fixture(scope="module")
def workspace() -> Workspace:
    return Workspace()


@pytest.mark.parametrize("number", [1, 2, 4])
def test_narrow_yards_in_which_the_best_states_lead_nowhere_are_solved(
    number: int, workspace: Workspace
) -> None:
    problem = to_canonical(family("yard", "hard", CAR_1_TRAILER).draw(11, number))[0]
    limits = Limits(expansions=12_000, seconds=600.0)  # with 20,000 none was, without regions
    vehicle = {"vehicle": CAR_1_TRAILER, "workspace": workspace}
    found = solve(problem, "lattice", "none", **vehicle, limits=limits, polished=False)
    assert found.plan is not None
    assert not faults(problem, found.plan, CAR_1_TRAILER)


def test_states_that_hardly_differ_share_a_region() -> None:
    tree = allocate_pose_tree(state_size(CAR_1_TRAILER))
    tree.states[0] = 3.0, -2.0, 0.2, 0.0, 0.0, 0.1
    plant_root(tree, tree.states[0].copy())
    here = region_of(load(tree.states, 0, CAR_1_TRAILER), tree, CAR_1_TRAILER)
    tree.states[1] = tree.states[0] + [0.1 * LENGTH, 0.1 * LENGTH, 0.1, 0.0, 0.0, 0.1]
    assert region_of(load(tree.states, 1, CAR_1_TRAILER), tree, CAR_1_TRAILER) == here
    for changed, by in ((0, LENGTH), (1, -LENGTH), (2, 1.0), (2, 3.0), (5, 0.8), (5, -0.8)):
        tree.states[1] = tree.states[0]
        tree.states[1, changed] += by
        assert region_of(load(tree.states, 1, CAR_1_TRAILER), tree, CAR_1_TRAILER) != here
