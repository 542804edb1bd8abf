import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from planners.search.guides.guidance import published_guidance
from planners.search.structures.roadmap import (
    ANYWHERE,
    BLOCKED,
    CHECKS,
    EDGES,
    GOAL,
    NODES,
    START,
    RoadmapSettings,
    allocate_roadmap,
    build_roadmap,
    resample_path,
)
from planners.world.geometry.clearance import clearance, strip_is_free
from planners.world.geometry.collision import scene_of
from planners.world.goal import goal_of
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR
from tests.worlds import strewn, walled_goal


def shape(problem):
    return shapely.union_all([shapely.Polygon(piece) for piece in problem.obstacles.pieces()])


def build(problem, settings, seed=0, guide=ANYWHERE):
    scene = scene_of(problem)
    roadmap = allocate_roadmap(settings.most_nodes, settings.neighbours)
    goal = goal_of(problem, CAR)
    start = np.array([*problem.start, 0.0, 0.0])
    joined = build_roadmap(roadmap, start, goal, guide, settings, CAR, scene, generator(seed).bit_generator)
    return roadmap, joined, scene


@pytest.mark.parametrize("exponent", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_ways_to_the_goal_are_as_short_as_scipys(seed, exponent):
    problem = strewn(seed, 40)
    roadmap, joined, scene = build(problem, RoadmapSettings(clearance_exponent=exponent), seed)
    count, edges = roadmap.counts[NODES], roadmap.counts[EDGES]
    rows, columns, costs = [], [], []
    for edge in range(edges):
        a, b = roadmap.edge_to[2 * edge], roadmap.edge_to[2 * edge + 1]
        free, _ = strip_is_free(*roadmap.nodes[a], *roadmap.nodes[b], CAR.width / 2, scene)
        assert not (free and roadmap.edge_state[edge] == BLOCKED)
        if free:
            room = max(min(roadmap.clearances[a], roadmap.clearances[b]), 1e-3) if exponent else 1.0
            rows.append(a)
            columns.append(b)
            costs.append(roadmap.edge_length[edge] / room**exponent)
    graph = coo_matrix((costs, (rows, columns)), (count, count))
    expected = dijkstra(graph, directed=False, indices=GOAL)
    np.testing.assert_allclose(roadmap.distances[:count], expected)
    assert joined == np.isfinite(expected[START])


@pytest.mark.parametrize("seed", range(5))
def test_nodes_lie_near_the_recalled_plan_until_start_and_goal_need_more(seed):
    line = np.linspace(0.0, 50.0, 60)[:, None] * np.ones(2)
    guide = published_guidance([line])
    roadmap, joined, _ = build(strewn(seed, 15), RoadmapSettings(), seed, guide)
    assert joined
    nodes = roadmap.nodes[2 : roadmap.counts[NODES]]
    near = np.hypot(*(nodes[:, None] - line).T).min(0) <= 4.0
    elsewhere = 1.0 - guide.probabilities.sum() - guide.goal_probability
    assert near.mean() > 1.0 - 2.0 * elsewhere
    assert (
        near.mean()
        > 1.5
        * (
            np.hypot(*(build(strewn(seed, 15), RoadmapSettings(), seed)[0].nodes[2:80, None] - line).T).min(0)
            <= 4.0
        ).mean()
    )


@given(st.integers(0, 10**6))
@settings(max_examples=30)
def test_a_strip_that_is_free_misses_every_obstacle(seed):
    problem = strewn(seed % 7, 60)
    scene = scene_of(problem)
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-5, 55, 2), rng.uniform(-5, 55, 2)
    strip = shapely.LineString([a, b]).buffer(CAR.width / 2, cap_style="flat")
    expected = not strip.intersects(shape(problem)) and shapely.box(*problem.bounds).contains(strip)
    assert strip_is_free(*a, *b, CAR.width / 2, scene)[0] == expected


@given(st.integers(0, 10**6))
@settings(max_examples=50)
def test_clearance_is_the_distance_to_the_nearest_obstacle_or_bound(seed):
    problem = strewn(seed % 7, 60)
    x, y = np.random.default_rng(seed).uniform(-6, 56, 2)
    point = shapely.Point(x, y)
    expected = min(5.0, point.distance(shape(problem)), point.distance(shapely.box(*problem.bounds).exterior))
    assert clearance(x, y, 5.0, scene_of(problem)) == pytest.approx(expected, abs=1e-9)


def test_a_goal_behind_walls_is_given_up_at_the_most_nodes():
    roadmap, joined, _ = build(walled_goal(), RoadmapSettings(most_nodes=500))
    assert not joined
    assert roadmap.counts[NODES] <= 500
    assert roadmap.counts[CHECKS] > 0


def test_a_resampled_way_has_even_steps_and_ends_at_the_goal():
    problem = strewn(3, 40)
    roadmap, joined, _ = build(problem, RoadmapSettings(), 3)
    assert joined
    points = np.empty((256, 2))
    filled = resample_path(roadmap, START, 3.0, points)
    steps = np.hypot(*np.diff(points[:filled], axis=0).T)
    assert steps.max() <= 3.0 + 1e-9
    np.testing.assert_allclose(points[0], problem.start[:2])
    np.testing.assert_allclose(points[filled - 1], problem.goal)
