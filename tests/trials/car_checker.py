"""A second judge of the car's plans: shapely and an integration of its own, no code of authority or kernels.

It takes the car from docs/planners.md. A step of a plan is driven in ``PARTS`` shorter steps. Between two of
these a corner of the body leaves its chord by at most an eighth of the squared time times its acceleration.
So the body stays within that distance of the convex hull of both footprints, which must be free. There is no
tolerance on collisions.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import shapely

from planners.world.problem import Arrival, Floats, Plan, Problem

WHEELBASE: Final = 1.6  # metres
REAR, FRONT, SIDE = -0.2, 1.8, 0.45  # metres from the rear axle
STEP: Final = 0.1  # seconds
PARTS: Final = 4  # of a step; the corners are then within some 3 mm of their chords
SPEED, STEERING = (-1.0, 4.0), (-math.radians(40.0), math.radians(40.0))  # m/s, radians
ACCELERATION, STEERING_RATE = (-2.0, 2.0), (-1.6, 1.6)  # m/s^2, rad/s
ROUNDING: Final = 1e-9
OFFSET: Final = 1e-6  # metres, radians, m/s: the contract's tolerance
ROUNDED_STEP: Final = 1e-11  # per step, so that 500 steps along 100 m stay within the contract's
ONE_STEP: Final = 5e-5  # between a Runge-Kutta step of 0.1 s and the motion itself


def slopes(state: Floats, control: Floats) -> Floats:
    """How fast states ``[..., 5]`` change under controls ``[..., 2]``."""
    _, _, heading, speed, steering = np.moveaxis(state, -1, 0)
    turn = speed * np.tan(steering) / WHEELBASE
    rates = [speed * np.cos(heading), speed * np.sin(heading), turn, control[..., 0], control[..., 1]]
    return np.stack(rates, axis=-1)


def driven(state: Floats, control: Floats, seconds: float) -> Floats:
    """States ``[..., 5]`` after one classical Runge-Kutta step."""
    k1 = slopes(state, control)
    k2 = slopes(state + 0.5 * seconds * k1, control)
    k3 = slopes(state + 0.5 * seconds * k2, control)
    k4 = slopes(state + seconds * k3, control)
    moved: Floats = state + seconds / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return moved


def corners(states: Floats) -> Floats:
    """The body's corners ``[..., 4, 2]`` at states ``[..., 5]``."""
    cos, sin = np.cos(states[..., 2, None]), np.sin(states[..., 2, None])
    ahead, aside = np.array([REAR, FRONT, FRONT, REAR]), np.array([-SIDE, -SIDE, SIDE, SIDE])
    x = states[..., 0, None] + ahead * cos - aside * sin
    y = states[..., 1, None] + ahead * sin + aside * cos
    return np.stack((x, y), axis=-1)


def wrong_with(problem: Problem, plan: Plan) -> list[str]:
    """What is wrong with a car's ``plan`` for a ``problem``: names of faults, none when it is good."""
    states, controls = plan.states, plan.controls
    limited = {
        "speed": (states[:, 3], SPEED),
        "steering": (states[:, 4], STEERING),
        "acceleration": (controls[:, 0], ACCELERATION),
        "steering rate": (controls[:, 1], STEERING_RATE),
    }
    found = [
        name
        for name, (values, (low, high)) in limited.items()
        if values.min() < low - ROUNDING or values.max() > high + ROUNDING
    ]
    if plan.dt != STEP:
        found.append("time step")
    motion_asked = [*problem.start_motion, 0.0, 0.0][:2]
    if np.abs(states[0] - [*problem.start, *motion_asked]).max() > OFFSET:
        found.append("start")
    if math.hypot(*(states[-1, :2] - problem.goal)) > problem.goal_radius + ROUNDING:
        found.append("goal")
    if problem.arrival is not None and arrives_wrong(states[-1], problem.arrival):
        found.append("arrival")
    if np.abs(driven(states[:-1], controls, STEP) - states[1:]).max() > ROUNDED_STEP:
        found.append("dynamics")
    motion, aside = motion_of(states, controls)
    if np.abs(motion[:, -1] - states[1:]).max() > ONE_STEP:
        found.append("motion")
    return found + contacts(problem, corners(motion), aside)


def arrives_wrong(last: Floats, asked: Arrival) -> bool:
    """Whether the ``last [5]`` state has another heading or speed than is asked for."""
    low, high = asked.least_speed - OFFSET, asked.most_speed + OFFSET
    if not low <= last[3] <= high:
        return True
    if asked.heading is None:
        return False
    off = np.angle(np.exp(1j * (last[2] - asked.heading)))
    return bool(abs(off) > asked.heading_tolerance + OFFSET)


def motion_of(states: Floats, controls: Floats) -> tuple[Floats, float]:
    """States ``[T - 1, PARTS + 1, 5]`` within each step, and how far (m) a corner may leave its chords."""
    motion = [states[:-1]]
    for _ in range(PARTS):
        motion.append(driven(motion[-1], controls, STEP / PARTS))
    within = np.stack(motion, axis=1)
    speed, steering = np.abs(within[..., 3]).max(axis=1), np.abs(within[..., 4]).max(axis=1)
    acceleration, rate = np.abs(controls).T
    turn = speed * np.tan(steering) / WHEELBASE
    twist = (acceleration * np.tan(steering) + speed * rate / np.cos(steering) ** 2) / WHEELBASE
    reach = math.hypot(FRONT, SIDE)
    most = acceleration + speed * turn + reach * (turn**2 + twist)
    return within, float(most.max() * (STEP / PARTS) ** 2 / 8.0)


def contacts(problem: Problem, body: Floats, aside: float) -> list[str]:
    """Whether a body, its corners ``[T - 1, PARTS + 1, 4, 2]``, may meet the bounds or an obstacle."""
    found = []
    low, high = np.array(problem.bounds[:2]), np.array(problem.bounds[2:])
    if (body - aside < low).any() or (body + aside > high).any():
        found.append("bounds")
    pairs = np.concatenate((body[:, :-1], body[:, 1:]), axis=2).reshape(-1, 8, 2)
    hulls = shapely.convex_hull(shapely.multipoints(pairs))
    obstacles = problem.obstacles
    owner = np.repeat(np.arange(len(obstacles.piece_starts) - 1), np.diff(obstacles.piece_starts))
    pieces = shapely.polygons(shapely.linearrings(obstacles.vertices, indices=owner))
    if len(shapely.STRtree(pieces).query(hulls, predicate="dwithin", distance=aside)[0]):
        found.append("collision")
    return found
