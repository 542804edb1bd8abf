"""A planning problem, and a plan that solves it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Bounds, Floats, Integers, Point, Pose
from planners.world.jit import lean
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size

CANONICAL_START = (0.0, 0.0, math.pi / 4)  # metres, metres, radians: facing the goal
CANONICAL_GOAL = (50.0, 50.0)  # metres
CANONICAL_DISTANCE = math.hypot(*CANONICAL_GOAL)
GOAL_RADIUS = 2.0  # metres
POSE_RADIUS = 0.1  # metres: the usual tolerances of a goal pose
POSE_TOLERANCE = 0.05  # radians
BOUNDS = (-7.0, -7.0, 57.0, 57.0)  # x_min, y_min, x_max, y_max in metres


_ROUNDING = 1e-9  # metres


class Obstacles(NamedTuple):
    """Obstacles as groups of convex pieces. Coordinates are exact in float32, so files keep them exactly."""

    vertices: Floats  # [V, 2] metres, counter-clockwise within each piece
    piece_starts: Integers  # [P + 1] piece p owns vertices[piece_starts[p] : piece_starts[p + 1]]
    obstacle_starts: Integers  # [O + 1] obstacle o owns pieces obstacle_starts[o] : obstacle_starts[o + 1]

    def pieces(self) -> list[Floats]:
        """The convex pieces, each ``[n, 2]`` metres."""
        return np.split(self.vertices, self.piece_starts[1:-1]) if len(self.piece_starts) > 1 else []


class Arrival(NamedTuple):
    """What is asked at the goal besides the place. The default asks for nothing more."""

    heading: float | None = None  # radians; None: any
    heading_tolerance: float = 0.0  # radians
    least_speed: float = -math.inf  # m/s, below 0 backwards
    most_speed: float = math.inf  # m/s
    hitches: tuple[float, ...] = ()  # radians, one a trailer; none: any
    hitch_tolerances: tuple[float, ...] = ()  # radians, one a trailer

    @property
    def is_rest(self) -> bool:
        """Whether the vehicle is to stand: a differential drive must not turn then either."""
        return self.least_speed == self.most_speed == 0.0


@dataclass(frozen=True, eq=False)
class Problem:
    """Start state, goal, bounds and obstacles (docs/method.md: ``S``)."""

    id: str
    class_name: str
    start: Pose
    goal: Point
    goal_radius: float  # metres: how far from the goal a drive may end
    bounds: Bounds
    obstacles: Obstacles
    scale: float = 1.0  # real metres in one metre of this problem; files hold real metres
    start_motion: tuple[float, ...] = ()  # the start state behind the pose, speed first; what is missing is 0
    arrival: Arrival | None = None  # None: any heading and speed will do
    offset: Point = (0.0, 0.0)  # real metres: where the origin of this frame lies in that of the file

    @property
    def asks_for_pose(self) -> bool:
        """Whether the heading at the goal matters."""
        return self.arrival is not None and self.arrival.heading is not None


@dataclass(frozen=True, eq=False)
class Plan:
    """States and the controls between them at a fixed time step (docs/method.md: ``P``)."""

    states: Floats  # [T, S] x (m), y (m), heading (rad), speed (m/s), then the rest of the vehicle's state
    controls: Floats  # [T - 1, 2] for a car acceleration (m/s^2) and steering rate (rad/s)
    dt: float = CAR.dt  # seconds

    @property
    def length_m(self) -> float:
        """Length of the path of the reference point, in metres."""
        return _path_length(self.states)

    @property
    def duration_s(self) -> float:
        """Driving time in seconds."""
        return self.dt * len(self.controls)

    @property
    def lateral_acceleration(self) -> float:
        """The largest acceleration to the side, in m/s²: speed times turn rate, by mean over each step."""
        turned = np.abs(np.diff(np.unwrap(self.states[:, 2])))
        metres = np.hypot(*np.diff(self.states[:, :2], axis=0).T)
        return float(np.max(metres * turned, initial=0.0)) / self.dt**2


@lean
def _path_length(states: Floats) -> float:
    metres = 0.0
    for i in range(1, states.shape[0]):
        metres += math.hypot(states[i, 0] - states[i - 1, 0], states[i, 1] - states[i - 1, 1])
    return metres


def obstacles_of(groups: list[list[Floats]]) -> Obstacles:
    """Pack obstacles, each a list of convex pieces ``[n, 2]`` (metres) in any orientation."""
    pieces = [counter_clockwise(piece) for group in groups for piece in group]
    vertices = np.concatenate(pieces) if pieces else np.empty((0, 2))
    return Obstacles(
        np.ascontiguousarray(vertices.astype(np.float32).astype(np.float64)),
        np.cumsum([0] + [len(piece) for piece in pieces], dtype=np.int32),
        np.cumsum([0] + [len(group) for group in groups], dtype=np.int32),
    )


def counter_clockwise(polygon: Floats) -> Floats:
    """Return a polygon ``[n, 2]`` with its vertices in counter-clockwise order."""
    x, y = polygon[:, 0], polygon[:, 1]
    area = float(x[:-1] @ y[1:] - y[:-1] @ x[1:] + x[-1] * y[0] - y[-1] * x[0])
    return polygon if area >= 0.0 else polygon[::-1]


def has_canonical_ends(problem: Problem) -> bool:
    """Whether start and goal lie where those of canonical problems do, whatever the motion there."""
    return (
        math.hypot(problem.start[0], problem.start[1]) <= _ROUNDING
        and math.dist(problem.goal, CANONICAL_GOAL) <= problem.goal_radius + _ROUNDING
    )


def is_canonical(problem: Problem) -> bool:
    """Whether a problem asks what memories answer: from rest, all straight, to the canonical place."""
    return has_canonical_ends(problem) and not any(problem.start_motion) and problem.arrival is None


def begins_straight(problem: Problem) -> bool:
    """Whether a problem with canonical ends begins in the direction of its goal."""
    return abs(problem.start[2] - CANONICAL_START[2]) <= _ROUNDING


def start_state(problem: Problem, vehicle: Vehicle = CAR) -> Floats:
    """Return the state ``[S]`` at the start: unless the problem says more, at rest and all straight.

    A vehicle that cannot be at rest begins with its least speed.
    """
    state = np.zeros(state_size(vehicle))
    state[:3] = problem.start
    state[3] = max(vehicle.min_speed, 0.0)
    state[3 : 3 + len(problem.start_motion)] = problem.start_motion
    return state


def starting_at(problem: Problem, state: Floats) -> Problem:
    """The problem as it is asked from a ``state [S]`` on."""
    x, y, heading, *motion = state.tolist()
    return replace(problem, start=(x, y, heading), start_motion=tuple(motion))
