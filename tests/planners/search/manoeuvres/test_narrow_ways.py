"""Where coarse searches found nothing, ways that are too narrow count as occupied, and no others."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from planners.search.manoeuvres.manoeuvring import Manoeuvring
from planners.search.manoeuvres.narrow_ways import too_narrow
from planners.search.query import Limits, Query
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import GRID, drawing_of, grid_of, window_of
from planners.world.goal import goal_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle
from tests.planners.world.strategies import seeds
from tests.worlds import box, problem_of, strewn

WORKSPACE = Workspace()
ROBOT = said_vehicle("docs/vehicles/turtlebot.yaml")
LOT, _ = to_canonical(family("lot", "standard", ROBOT).draw(91, 15))  # a gap behind the slot is too narrow
SHARES = np.linspace(0.05, 0.95, 3)  # of a cell, where it is looked at


def narrow_cells(problem: Problem, vehicle: Vehicle) -> np.ndarray:
    """Whether each cell ``[rows, columns]`` of the problem's window is too narrow."""
    return grid_of(too_narrow(scene_of(problem), window_of(problem), vehicle, WORKSPACE)).astype(bool)


@given(seed=seeds, width=st.floats(0.2, 4.0))
def test_where_a_vehicle_has_room_on_both_sides_no_cell_is_closed(seed: int, width: float) -> None:
    problem, vehicle = strewn(seed, 12), CAR._replace(width=width)
    left, bottom, cell_m = window_of(problem)
    along = (np.arange(GRID)[:, None] + SHARES).ravel() * cell_m
    x, y = np.meshgrid(left + along, bottom + along)
    pieces = np.split(problem.obstacles.vertices, problem.obstacles.piece_starts[1:-1])
    blocked = shapely.union_all([shapely.Polygon(piece) for piece in pieces])
    x_min, y_min, x_max, y_max = problem.bounds
    to_bounds = np.minimum.reduce([x - x_min, x_max - x, y - y_min, y_max - y])
    free_m = np.minimum(shapely.distance(shapely.points(x, y), blocked), to_bounds)
    roomy = (free_m > 0.5 * width).reshape(GRID, len(SHARES), GRID, len(SHARES)).any(axis=(1, 3))
    assert not np.any(roomy & narrow_cells(problem, vehicle))


@given(gap=st.floats(0.0, 6.0))
def test_a_gap_is_closed_to_who_is_wider(gap: float) -> None:
    walls = [box(25.0, 25.0 + side * (30.0 + 0.5 * gap), 0.0, 1.0, 30.0) for side in (-1, 1)]
    problem, vehicle = problem_of(walls), CAR._replace(width=2.5)
    left, _, cell_m = window_of(problem)
    within = narrow_cells(problem, vehicle)[:, int((25.0 - left) / cell_m)]
    if gap < vehicle.width - cell_m:
        assert within.all()
    elif gap > vehicle.width:
        assert not within.all()


def test_what_one_search_closes_stays_open_to_others() -> None:
    query = Query(LOT, generator(1), scene_of(LOT), Workspace(), vehicle=ROBOT)
    search = Manoeuvring(query, goal_of(LOT, ROBOT), drawing_of(LOT).occupied)
    at_first = search._start_end.go.costs.copy()
    search._close_narrow_ways()
    closed = search._start_end.go.costs.copy()
    slimmer = search.of_slimmer(query, 0.2)
    assert np.array_equal(slimmer._start_end.go.costs, at_first)
    slimmer._close_narrow_ways()
    assert np.array_equal(search._start_end.go.costs, closed)
    assert not np.array_equal(slimmer._start_end.go.costs, closed)


def test_a_gap_too_narrow_for_the_robot_does_not_hold_the_search_up() -> None:
    limits = Limits(expansions=30_000)  # before, 60,000 were not enough
    found = solve(LOT, "lattice", vehicle=ROBOT, limits=limits)
    assert found.plan is not None
