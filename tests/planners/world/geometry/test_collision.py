from __future__ import annotations

import math
from typing import NamedTuple

import fcl
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.world.arrays import Floats
from planners.world.authority.authority_sweeps import prism
from planners.world.geometry import collision
from planners.world.geometry.collision import (
    Scene,
    box_is_free,
    box_meets_piece,
    build_scene,
    count_free_prefix,
    scene_of,
)
from planners.world.jit import jit
from planners.world.problem import BOUNDS, obstacles_of
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.reach import REACH_M
from planners.world.vehicles.vehicle import (
    CAR,
    CAR_1_TRAILER,
    CAR_2_TRAILERS,
    VEHICLES,
    Vehicle,
    name_of,
    state_size,
)
from tests.planners.world.kernels import state_is_free, step
from tests.planners.world.motions import exact_motion, random_controls, random_state
from tests.planners.world.strategies import angles, box_corners, clutter, convex_polygon, problem_with, seeds

CONTACT = 1e-9  # metres: nearer to touching than this, either answer is right
HALF_LENGTH = 0.5 * (CAR.front + CAR.rear)
HALF_WIDTH = 0.5 * CAR.width


class Pairs(NamedTuple):
    """Footprints, each near one piece."""

    poses: Floats  # [n, 3] x, y of the footprint's centre, direction
    pieces: Floats  # [n] the piece that each is tried against
    scene: Scene
    polygons: list[Floats]


def random_pairs(rng: np.random.Generator, count: int, polygon_count: int = 500) -> Pairs:
    """Footprints around pieces, about as often touching as not."""
    polygons = [convex_polygon(rng, rng.uniform(0.2, 3.0)) for _ in range(polygon_count)]
    obstacles = obstacles_of([[polygon] for polygon in polygons])
    pieces = rng.integers(0, polygon_count, count)
    radii = np.array([np.hypot(*polygon.T).max() for polygon in polygons])
    distance = rng.uniform(0.0, 1.0, count) * (radii[pieces] + 1.1)
    direction = rng.uniform(-math.pi, math.pi, count)
    poses = np.column_stack((
        distance * np.cos(direction), distance * np.sin(direction), rng.uniform(-math.pi, math.pi, count)
    ))  # fmt: skip
    scene = build_scene(obstacles.vertices, obstacles.piece_starts, np.array([-9.0, -9.0, 9.0, 9.0]))
    return Pairs(poses, pieces, scene, obstacles.pieces())


@jit
def kernel_answers(
    poses: Floats, pieces: Floats, half_length: float, half_width: float, scene: Scene
) -> Floats:
    """Whether each footprint meets its piece, by the planners' kernel."""
    meets = np.empty(poses.shape[0], np.bool_)
    for i in range(poses.shape[0]):
        x, y, heading = poses[i, 0], poses[i, 1], poses[i, 2]
        box = (x, y, math.cos(heading), math.sin(heading), half_length, half_width)
        first, last = scene.piece_starts[pieces[i]], scene.piece_starts[pieces[i] + 1]
        meets[i] = box_meets_piece(box, first, last, scene.edges)
    return meets


def fcl_answers(pairs: Pairs) -> Floats:
    """The same by FCL."""
    bodies = [prism(polygon) for polygon in pairs.polygons]
    body = fcl.CollisionObject(fcl.Box(2.0 * HALF_LENGTH, 2.0 * HALF_WIDTH, 1.0))
    request, meets = fcl.CollisionRequest(), np.empty(len(pairs.poses), bool)
    cos, sin = np.cos(pairs.poses[:, 2]), np.sin(pairs.poses[:, 2])
    rotations = np.zeros((len(pairs.poses), 3, 3))
    rotations[:, 0, 0] = rotations[:, 1, 1] = cos
    rotations[:, 0, 1], rotations[:, 1, 0], rotations[:, 2, 2] = -sin, sin, 1.0
    places = np.column_stack((pairs.poses[:, :2], np.zeros(len(pairs.poses))))
    for i, piece in enumerate(pairs.pieces):
        body.setTransform(fcl.Transform(rotations[i], places[i]))
        meets[i] = fcl.collide(body, bodies[piece], request, fcl.CollisionResult()) > 0
    return meets


def assert_agreement(pairs: Pairs) -> None:
    """Kernel and FCL agree; where they do not, shapely finds the kernel right or the pair in contact."""
    kernel = kernel_answers(pairs.poses, pairs.pieces, HALF_LENGTH, HALF_WIDTH, pairs.scene)
    assert 0.2 < kernel.mean() < 0.8
    for i in np.flatnonzero(kernel != fcl_answers(pairs)):
        polygon = shapely.Polygon(pairs.polygons[pairs.pieces[i]])
        if kernel[i]:
            footprint = shapely.Polygon(box_corners(*pairs.poses[i], HALF_LENGTH, HALF_WIDTH))
            assert footprint.distance(polygon) <= CONTACT
        else:
            shrunk = box_corners(*pairs.poses[i], HALF_LENGTH - CONTACT, HALF_WIDTH - CONTACT)
            assert not shapely.Polygon(shrunk).intersects(polygon)


def test_kernel_and_fcl_agree_on_footprints_near_obstacles() -> None:
    assert_agreement(random_pairs(np.random.default_rng(0), 20_000))


@pytest.mark.slow
def test_kernel_and_fcl_agree_on_a_million_footprints_near_obstacles() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        assert_agreement(random_pairs(rng, 50_000))


@settings(max_examples=40)
@given(seeds)
def test_a_box_meets_a_piece_exactly_where_shapely_says_so(seed: int) -> None:
    pairs = random_pairs(np.random.default_rng(seed), 50, 5)
    kernel = kernel_answers(pairs.poses, pairs.pieces, HALF_LENGTH, HALF_WIDTH, pairs.scene)
    for pose, piece, meets in zip(pairs.poses, pairs.pieces, kernel, strict=True):
        polygon = shapely.Polygon(pairs.polygons[piece])
        grown = shapely.Polygon(box_corners(*pose, HALF_LENGTH + CONTACT, HALF_WIDTH + CONTACT))
        shrunk = shapely.Polygon(box_corners(*pose, HALF_LENGTH - CONTACT, HALF_WIDTH - CONTACT))
        assert not meets or grown.intersects(polygon)
        assert meets or not shrunk.intersects(polygon)


@settings(max_examples=30)
@given(seeds)
def test_a_box_is_free_exactly_where_shapely_says_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = problem_with(clutter(rng, 40))
    scene = scene_of(problem)
    tree = shapely.STRtree([shapely.Polygon(piece) for piece in problem.obstacles.pieces()])
    inside = shapely.box(*BOUNDS)
    for _ in range(50):
        x, y = rng.uniform(BOUNDS[0] - 1.0, BOUNDS[2] + 1.0, 2)
        heading = rng.uniform(-math.pi, math.pi)
        half_length = rng.uniform(0.01, 1.5)
        half_width = rng.uniform(0.01, math.sqrt(REACH_M**2 - half_length**2))

        def is_free(slack: float, box: tuple[float, ...] = (x, y, heading, half_length, half_width)) -> bool:
            footprint = shapely.Polygon(box_corners(*box[:3], box[3] + slack, box[4] + slack))
            return inside.covers(footprint) and not len(tree.query(footprint, "intersects"))

        box = (x, y, math.cos(heading), math.sin(heading), half_length, half_width)
        free = box_is_free(box, scene)
        assert not free or is_free(-CONTACT)
        assert free or not is_free(CONTACT)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
@settings(max_examples=40)
@given(seed=seeds)
def test_what_a_step_sweeps_between_two_free_states_is_free(vehicle: Vehicle, seed: int) -> None:
    """A splinter 1 mm wide, planted anywhere that a body passes, is seen from one of the states."""
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    state[:2] = 25.0
    controls = random_controls(rng, state, vehicle)
    end = step(tuple(state), *controls, vehicle)
    between = exact_motion(state, controls, rng.uniform(0.0, vehicle.dt, 1), vehicle)
    corner = rng.choice(footprints(between, vehicle).reshape(-1, 2))
    splinter = box_corners(*corner, rng.uniform(-math.pi, math.pi), 5e-4, 5e-4)
    scene = scene_of(problem_with(obstacles_of([[splinter]])))
    assert not (state_is_free(tuple(state), vehicle, scene) and state_is_free(end, vehicle, scene))


@pytest.mark.parametrize("vehicle", [CAR_1_TRAILER, CAR_2_TRAILERS], ids=name_of)
def test_a_jack_knifed_vehicle_is_not_free(vehicle: Vehicle) -> None:
    scene = scene_of(problem_with(obstacles_of([])))
    for hitch in range(5, state_size(vehicle)):
        for angle in (-1.001, -0.999, 0.999, 1.001):
            state = np.array([25.0, 25.0, *[0.0] * (state_size(vehicle) - 2)])
            state[hitch] = angle
            assert state_is_free(tuple(state), vehicle, scene) == (abs(angle) < 1.0)


@given(st.floats(2.5, 50.0), angles, st.floats(-0.5, 0.5))
def test_a_thin_wall_across_the_way_is_never_jumped(distance: float, heading: float, tilt: float) -> None:
    wall = box_corners(
        25.0 + 0.4 * distance * math.cos(heading), 25.0 + 0.4 * distance * math.sin(heading),
        heading + tilt, 5e-4, 10.0,
    )  # fmt: skip
    scene = scene_of(problem_with(obstacles_of([[wall]])))
    states = np.zeros((60, 5))
    travelled = CAR.max_speed * CAR.dt * np.arange(60)
    states[:, 0] = 25.0 + travelled * math.cos(heading)
    states[:, 1] = 25.0 + travelled * math.sin(heading)
    states[:, 2] = heading
    states[:, 3] = CAR.max_speed
    assert count_free_prefix(states, CAR, scene) * CAR.max_speed * CAR.dt < 0.4 * distance / math.cos(tilt)


@settings(max_examples=20)
@given(seeds)
def test_kernels_equal_their_python_functions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = problem_with(clutter(rng, 10))
    scene = scene_of(problem)
    vertices = np.ascontiguousarray(scene.edges[:, 3:])
    plain = build_scene.py_func(vertices, scene.piece_starts, scene.bounds)  # type: ignore[attr-defined]
    for compiled, interpreted in zip(scene, plain, strict=True):
        assert np.allclose(compiled, interpreted, rtol=0.0, atol=1e-12)
    for _ in range(20):
        state = random_state(rng, CAR)
        interpreted = collision.state_is_free.py_func(tuple(state), CAR, scene)  # type: ignore[attr-defined]
        assert state_is_free(tuple(state), CAR, scene) == interpreted
