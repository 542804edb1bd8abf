"""The motion tree: every state that an extension drives through is a vertex."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from planners.search.neighbours import Buckets, Indices, allocate_buckets, clear_buckets, put, remove
from planners.world.collision import Scene, state_is_free
from planners.world.dynamics import admissible, step
from planners.world.jit import inlined, jit
from planners.world.problem import Floats, Plan
from planners.world.vehicle import Vehicle

# places in Tree.counts
SIZE, CHECKS, EXPANSIONS, GOAL_VERTEX = range(4)


class Tree(NamedTuple):
    """Vertices in the order in which they were reached; buffers are kept from problem to problem."""

    states: Floats  # [C, 5]
    controls: Floats  # [C, 2] that led here from the parent
    parents: Indices  # [C]
    depths: Indices  # [C] steps from the root
    waypoints: Indices  # [C] next waypoint of the lead path (Follow)
    spent: Indices  # [C] 1 where an extension collided in its first step: no control leads on from there
    counts: Indices  # [4] SIZE, CHECKS, EXPANSIONS, GOAL_VERTEX (-1: not reached)
    buckets: Buckets


class Extension(NamedTuple):
    """How a vertex is extended towards a target (docs/planners.md)."""

    steer_probability: float = 0.99  # else one random constant control
    metres_a_step: float = 0.5  # floor(distance / this) steps ...
    least_steps: int = 20  # ... plus a uniform number of these
    most_steps: int = 40
    arrival_m: float = 1.0  # a target is reached within this distance
    slowest_share: float = 0.95  # desired speed: U(this, 1) of the maximum
    proportional: float = 10.0
    integral: float = 0.1
    derivative: float = 0.1


EXTENSION = Extension()
BUCKET_M = 2.0  # vertices lie up to 0.4 m apart along an extension


@functools.lru_cache(maxsize=1)
def allocate_tree(capacity: int) -> Tree:
    """Buffers for ``capacity`` vertices, one set a process."""
    states = np.empty((capacity, 5))
    return Tree(
        states,
        np.empty((capacity, 2)),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.zeros(4, np.int64),
        allocate_buckets(states),
    )


@jit
def plant(tree: Tree, root: Floats, bounds: Floats) -> None:
    """Begin a new tree at the state ``root [5]``."""
    for i in range(5):  # one by one: assigning a row compiles for two seconds
        tree.states[0, i] = root[i]
    tree.controls[0, 0] = 0.0
    tree.controls[0, 1] = 0.0
    tree.parents[0] = -1
    tree.depths[0] = 0
    tree.waypoints[0] = 0
    tree.spent[0] = 0
    tree.counts.fill(0)
    tree.counts[SIZE] = 1
    tree.counts[GOAL_VERTEX] = -1
    clear_buckets(tree.buckets, bounds, BUCKET_M)
    put(tree.buckets, 0)


@inlined
def clamp(value: float, limit: float) -> float:
    """``value`` within plus and minus ``limit``."""
    return min(max(value, -limit), limit)


@inlined
def segment_distance(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Distance in metres from a point to the segment from a to b."""
    dx = bx - ax
    dy = by - ay
    squared = dx * dx + dy * dy
    share = 0.0
    if squared > 0.0:
        share = min(max(((x - ax) * dx + (y - ay) * dy) / squared, 0.0), 1.0)
    return math.hypot(x - ax - share * dx, y - ay - share * dy)


@jit
def extend(
    tree: Tree,
    vertex: int,
    target_x: float,
    target_y: float,
    goal: Floats,
    lead: Floats,
    tube_m: float,
    passing_m: float,
    settings: Extension,
    car: Vehicle,
    scene: Scene,
    rng: np.random.Generator,
) -> int:
    """Drive from ``vertex`` towards a target and add what is free; returns the number of new vertices.

    ``goal [3]``: x, y, radius in metres. Along a ``lead [m, 2]`` (empty: none) each vertex must keep within
    ``tube_m`` of the segment to its next waypoint, which is passed within ``passing_m``.
    """
    states = tree.states
    counts = tree.counts
    counts[EXPANSIONS] += 1
    x = states[vertex, 0]
    y = states[vertex, 1]
    heading = states[vertex, 2]
    speed = states[vertex, 3]
    steering = states[vertex, 4]
    waypoint = tree.waypoints[vertex]
    steered = rng.random() < settings.steer_probability
    spread = settings.most_steps - settings.least_steps + 1
    steps = int(math.hypot(target_x - x, target_y - y) / settings.metres_a_step)
    steps += settings.least_steps + int(rng.random() * spread)
    desired_speed = (settings.slowest_share + (1.0 - settings.slowest_share) * rng.random()) * car.max_speed
    acceleration = (2.0 * rng.random() - 1.0) * car.max_acceleration
    steering_rate = (2.0 * rng.random() - 1.0) * car.max_steering_rate
    turn_sum = 0.0
    speed_sum = 0.0
    last_turn = 0.0
    last_speed = 0.0
    first = counts[SIZE]
    parent = vertex
    for i in range(steps):
        if counts[SIZE] == states.shape[0]:
            break
        if steered:
            turn = math.atan2(target_y - y, target_x - x) - heading - steering
            turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
            lack = desired_speed - speed
            if i == 0:
                last_turn = turn
                last_speed = lack
            turn_sum += turn * car.dt
            speed_sum += lack * car.dt
            steering_rate = clamp(
                settings.proportional * turn
                + settings.integral * turn_sum
                + settings.derivative * (turn - last_turn) / car.dt,
                car.max_steering_rate,
            )
            acceleration = clamp(
                settings.proportional * lack
                + settings.integral * speed_sum
                + settings.derivative * (lack - last_speed) / car.dt,
                car.max_acceleration,
            )
            last_turn = turn
            last_speed = lack
        drive, turn_rate = admissible(speed, steering, acceleration, steering_rate, car)
        x, y, heading, speed, steering = step(x, y, heading, speed, steering, drive, turn_rate, car)
        counts[CHECKS] += 1
        if not state_is_free(x, y, heading, speed, steering, car, scene):
            break
        if lead.shape[0] > 0:
            while waypoint < lead.shape[0] - 1 and (
                math.hypot(lead[waypoint, 0] - x, lead[waypoint, 1] - y) < passing_m
            ):
                waypoint += 1
            before = max(waypoint - 1, 0)
            if (
                segment_distance(x, y, lead[before, 0], lead[before, 1], lead[waypoint, 0], lead[waypoint, 1])
                > tube_m
            ):
                break
        new = counts[SIZE]
        counts[SIZE] += 1
        states[new, 0] = x
        states[new, 1] = y
        states[new, 2] = heading
        states[new, 3] = speed
        states[new, 4] = steering
        tree.controls[new, 0] = drive
        tree.controls[new, 1] = turn_rate
        tree.parents[new] = parent
        tree.depths[new] = tree.depths[parent] + 1
        tree.waypoints[new] = waypoint
        tree.spent[new] = 0
        put(tree.buckets, new)
        parent = new
        if math.hypot(x - goal[0], y - goal[1]) <= goal[2]:
            counts[GOAL_VERTEX] = new
            break
        if math.hypot(x - target_x, y - target_y) < settings.arrival_m:
            break
    added = int(counts[SIZE] - first)
    if added == 0 and vertex > 0:  # one step is too short for the controls to make a difference
        tree.spent[vertex] = 1
        remove(tree.buckets, vertex)
    return added


def plan_to_goal(tree: Tree, dt: float) -> Plan:
    """The way from the root to the goal vertex."""
    chain = [int(tree.counts[GOAL_VERTEX])]
    while tree.parents[chain[-1]] >= 0:
        chain.append(int(tree.parents[chain[-1]]))
    chain.reverse()
    return Plan(tree.states[chain], tree.controls[chain[1:]], dt)
