from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import LineString, Polygon

from planners.memory.hallucination.minimal import Minimal
from planners.memory.hallucination.shortcut import (
    SIDE,
    STEP_M,
    close_around,
    distances_left,
    inflated_radius,
    lattice,
    shortest_path,
)
from planners.memory.plans.experience import Experience
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, Obstacles, Plan, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR
from tests.planners.memory.conftest import boxes, problem_around

SEEDS = st.integers(0, 2**32 - 1)
START = (0.0, 0.0)
RADIUS = inflated_radius(CAR.width)
LEFT = distances_left(CANONICAL_GOAL, 2.0)


def detour(rng: np.random.Generator, steps: int = 220) -> Experience:
    """A plan that swings far to one side and then to the other, which an empty world gives no reason for."""
    swing = rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 1.1)  # radians of heading
    rate = 2.0 * math.pi / rng.uniform(16.0, 20.0)  # radians of the swing a second
    steering = swing * rate * CAR.wheelbase / CAR.max_speed
    controls = np.zeros((steps, 2))
    controls[:20, 0] = CAR.max_acceleration
    controls[:10, 1] = steering / (10 * CAR.dt)
    controls[10:, 1] = -steering * rate * np.sin(rate * CAR.dt * np.arange(steps - 10))
    plan = Plan(simulate(np.array([*CANONICAL_START, 0.0, 0.0]), controls, CAR), controls)
    return Experience(problem_around(plan, obstacles_of([]), "detour"), plan)


@cache
def detours() -> list[Experience]:
    return [detour(generator(1, i)) for i in range(6)]


def left(experience: Experience):
    return distances_left(experience.problem.goal, experience.problem.goal_radius)


def closed_by(obstacles: Obstacles):
    closed = lattice(BOUNDS, CAR.width)
    for o in range(len(obstacles.obstacle_starts) - 1):
        close_around(obstacles, o, RADIUS, o, closed)
    return closed


def polygons_of(obstacles: Obstacles):
    return shapely.union_all([Polygon(piece) for piece in obstacles.pieces()])


def dijkstra_length(solid, goal) -> float:
    """The same lattice by SciPy and shapely: the length of the shortest way into the disc of 2 m."""
    rows, columns = np.divmod(np.arange(SIDE * SIDE), SIDE)
    x, y = BOUNDS[0] + STEP_M * columns, BOUNDS[1] + STEP_M * rows
    points = shapely.points(x, y)
    half = 0.5 * CAR.width
    is_open = (shapely.distance(points, solid) >= RADIUS) if not solid.is_empty else np.ones(len(x), bool)
    is_open &= (np.minimum(x, y) >= BOUNDS[0] + half) & (np.maximum(x, y) <= BOUNDS[2] - half)
    begins, ends, lengths = [], [], []
    for c in range(-2, 3):
        for r in range(-2, 3):
            if math.gcd(c, r) != 1:
                continue
            fits = is_open & (columns + c >= 0) & (columns + c < SIDE) & (rows + r >= 0) & (rows + r < SIDE)
            begin = np.flatnonzero(fits)
            passed = [(c, r)]
            if abs(c) == 2:
                passed += [(c // 2, 0), (c // 2, r)]
            elif abs(r) == 2:
                passed += [(0, r // 2), (c, r // 2)]
            for dc, dr in passed:
                begin = begin[is_open[begin + dr * SIDE + dc]]
            begins.append(begin)
            ends.append(begin + r * SIDE + c)
            lengths.append(np.full(len(begin), STEP_M * math.hypot(c, r)))
    edges = (np.concatenate(lengths), (np.concatenate(begins), np.concatenate(ends)))
    start = round(-BOUNDS[1] / STEP_M) * SIDE + round(-BOUNDS[0] / STEP_M)
    reached = dijkstra(coo_array(edges, (SIDE * SIDE, SIDE * SIDE)).tocsr(), indices=start)
    return float(reached[np.hypot(x - goal[0], y - goal[1]) <= 2.0].min())


@given(seed=SEEDS, count=st.integers(0, 40))
@settings(max_examples=8)
def test_the_shortest_way_is_dijkstras_and_keeps_clear(seed, count):
    obstacles = boxes(generator(seed), count)
    solid = polygons_of(obstacles)
    way = shortest_path(closed_by(obstacles), 0, START, LEFT, math.inf)
    expected = dijkstra_length(solid, CANONICAL_GOAL)
    assert way.length_m == pytest.approx(expected, abs=1e-9)
    if math.isfinite(expected):
        line = LineString(np.column_stack((way.points % SIDE, way.points // SIDE)) * STEP_M + BOUNDS[:2])
        assert line.length == pytest.approx(expected, abs=1e-9)
        assert count == 0 or line.distance(solid) >= 0.5 * CAR.width
        assert shortest_path(closed_by(obstacles), 0, START, LEFT, expected).length_m == math.inf
        assert shortest_path(closed_by(obstacles), 0, START, LEFT, expected + 1e-6).length_m < math.inf


@given(seed=SEEDS, saving=st.sampled_from([0.02, 0.05, 0.1]))
@settings(max_examples=6)
def test_removing_any_placed_obstacle_lets_a_shorter_way_through(seed, saving):
    experience = detours()[seed % len(detours())]
    goal, to_goal = experience.problem.goal, left(experience)
    placed = Minimal(saving=saving).obstacles(experience, generator(seed))
    count = len(placed.obstacle_starts) - 1
    limit = (1.0 - saving) * experience.plan.length_m
    closed = closed_by(placed)
    with_all = min(limit, shortest_path(closed, 0, START, to_goal, limit).length_m)
    assert min(limit, dijkstra_length(polygons_of(placed), goal)) == pytest.approx(with_all)
    assert count > 0
    for o in range(count):
        assert shortest_path(closed, 1 << o, START, to_goal, math.inf).length_m < with_all
    for o in {0, count - 1} & set(range(count)):
        others = [[piece] for k, piece in enumerate(placed.pieces()) if k != o]
        assert dijkstra_length(polygons_of(obstacles_of(others)), goal) < with_all


def test_shortcuts_that_save_more_are_closed():
    open_ways = []
    for i, experience in enumerate(detours()):
        limit = 0.9 * experience.plan.length_m
        placed = Minimal().obstacles(experience, generator(3, i))
        open_ways.append(shortest_path(closed_by(placed), 0, START, left(experience), limit).length_m < limit)
    assert np.mean(open_ways) <= 0.2  # where the sweep leaves no room for a polygon, shortcuts stay


def test_placed_polygons_keep_their_clearance():
    method = Minimal(clearance_m=(0.5, 0.5))
    for i, experience in enumerate(detours()):
        solid = polygons_of(method.obstacles(experience, generator(4, i)))
        way = LineString(experience.plan.states[:, :2])
        assert solid.is_empty or way.distance(solid) > 0.5 + 0.5 * CAR.width - 1e-6
