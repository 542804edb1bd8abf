"""Draws general questions in given worlds: from any motion, to a place or a pose at any distance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix, point_is_free, scene_of
from planners.world.problem import GOAL_RADIUS, POSE_RADIUS, POSE_TOLERANCE, Arrival, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate, turn_limit
from planners.world.vehicles.vehicle import CAR, FIRST_HITCH, Vehicle, state_size

DISTANCES_M: Final = (2.0, 70.0)  # from start to goal
STEERED: Final = 0.5  # share of the largest steering angle or turn rate, at most, at the start
BENT: Final = 0.3  # radians, at most, of each hitch at the start
BRAKING_STEPS: Final = 10_000  # what needs more to stand is too fast anywhere
TRIES: Final = 1_000  # draws until a world is given up


def question_in(
    world: Problem, number: int, seed: int, vehicle: Vehicle = CAR, pose: bool = False
) -> Problem | None:
    """Draw a question, always the same one for a world, number and seed.

    The start is uniform over the free poses of the world, at a speed from 0, or the vehicle's least, to the
    largest; the vehicle can still brake there. The goal is in any direction, at any of ``DISTANCES_M``. A
    pose has any heading, has room for the vehicle, all straight, and is to be arrived at at rest, or at any
    speed by a vehicle that cannot stop.

    Args:
        world: of which obstacles and bounds are taken.
        number: of the question.
        seed: of all questions.
        vehicle: what is to be driven.
        pose: whether to ask for a pose; otherwise for a disc of ``GOAL_RADIUS``.

    Returns:
        The question in the frame of the world, or None if ``TRIES`` draws have no room.
    """
    rng = generator(seed, "question", world.id, number, *(["pose"] if pose else []))
    scene = scene_of(world)
    asked = replace(world, id=f"{world.id}-question-{number}", goal_radius=GOAL_RADIUS, arrival=None)
    for _ in range(TRIES):
        begun = _started(asked, rng, vehicle)
        if not _can_stop(start_state(begun, vehicle), vehicle, scene):
            continue
        distance, bearing = rng.uniform(*DISTANCES_M), rng.uniform(-math.pi, math.pi)
        x = begun.start[0] + distance * math.cos(bearing)
        y = begun.start[1] + distance * math.sin(bearing)
        heading = rng.uniform(-math.pi, math.pi)
        if not pose:
            if point_is_free(x, y, scene):
                return replace(begun, goal=(x, y))
            continue
        parked = np.zeros((1, state_size(vehicle)))
        least = max(vehicle.min_speed, 0.0)
        parked[0, :4] = x, y, heading, least
        if count_free_prefix(parked, vehicle, scene):
            most = vehicle.max_speed if least > 0.0 else 0.0  # at rest, if it can be
            arrival = Arrival(heading, POSE_TOLERANCE, least, most)
            return replace(begun, goal=(x, y), goal_radius=POSE_RADIUS, arrival=arrival)
    return None


def _started(world: Problem, rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    low, high = np.array(world.bounds).reshape(2, 2)
    (x, y), heading = rng.uniform(low, high).tolist(), rng.uniform(-math.pi, math.pi)
    turn = STEERED * turn_limit(vehicle) * rng.uniform(-1.0, 1.0)
    bent = [BENT * rng.uniform(-1.0, 1.0) for _ in range(state_size(vehicle) - FIRST_HITCH)]
    speed = rng.uniform(max(vehicle.min_speed, 0.0), vehicle.max_speed)
    return replace(world, start=(x, y, heading), start_motion=(speed, turn, *bent))


def _can_stop(state: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether braking as hard as possible, with the steering as it is, is free until the vehicle stands."""
    most = vehicle.max_acceleration * vehicle.dt
    steps = math.ceil(state[3] / most)
    if steps > BRAKING_STEPS:
        return False
    controls = np.zeros((steps, 2))
    controls[:, 0] = -state[3] / max(steps, 1) / vehicle.dt
    return bool(count_free_prefix(simulate(state, controls, vehicle), vehicle, scene) == steps + 1)
