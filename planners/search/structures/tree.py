"""The tree of motions: every state that an extension drives through is a vertex."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import BitGenerator

from planners.search.connection.candidates import best_pace, list_connections, next_word
from planners.search.connection.connect import connect
from planners.search.connection.connection import (
    Connection,
    allocate_connection,
    first_pose,
    radius_at,
    word_speed,
)
from planners.search.connection.outline import outline_is_free
from planners.search.guides.sampling import uniform
from planners.search.structures.controller import NO_ERRORS, Gains, steer
from planners.search.structures.neighbours import Buckets, allocate_buckets, clear_buckets, put, remove
from planners.world.arrays import Floats, Indices
from planners.world.driving_cost import extra_along, extra_cost, gear_after, pays
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import asks_for_more, metres_to, reaches
from planners.world.jit import inlined, lean
from planners.world.problem import Plan
from planners.world.trigonometry import gap_to_segment, length
from planners.world.vehicles.dynamics import (
    State,
    admissible,
    control_limits,
    load,
    step,
    store,
)
from planners.world.vehicles.vehicle import Vehicle

# indices into Tree.counts
SIZE, CHECKS, EXPANSIONS, GOAL_VERTEX = range(4)


class Tree(NamedTuple):
    """Vertices in the order in which they were reached."""

    states: Floats  # [C, S]
    controls: Floats  # [C, 2] that led here from the parent
    parents: Indices  # [C]
    depths: Indices  # [C] steps from the root
    gears: Floats  # [C] in which it came here, 1 or -1; 0 if it has not moved
    extras: Floats  # [C] seconds that the way from the root costs beside its time
    waypoints: Indices  # [C] next waypoint of the lead path (Follow)
    spent: Indices  # [C] 1 after an extension that soon collided: too near an obstacle to lead anywhere
    counts: Indices  # [4] SIZE, CHECKS, EXPANSIONS, GOAL_VERTEX (-1: not reached)
    bound: Floats  # [1] seconds that a drive to the goal may cost; vertices that cost too much are not added
    buckets: Buckets
    connection: Connection


class Extension(NamedTuple):
    """How a vertex is extended towards a target (docs/planners.md)."""

    steer_probability: float = 0.99  # else a random control is kept constant
    metres_a_step: float = 0.5  # an extension has floor(distance / this) steps ...
    least_steps: int = 20  # ... plus a uniform number from here to ``most_steps``
    most_steps: int = 40
    least_added: int = 12  # a vertex from which fewer steps are free is not extended again
    arrival_m: float = 1.0  # within this distance a target is reached
    slowest_share: float = 0.95  # the desired speed is U(this, 1) of the maximum
    gains: Gains = Gains()


EXTENSION = Extension()
NO_LEAD = np.empty((0, 2))
CONNECT_M = 12.0  # from the goal: nearer vertices of an extension try to connect to it ...
CONNECT_EVERY = 10  # ... one in so many
OUTLINES = 8  # words of a connection that are glanced at ...
WORDS = 2  # ... and driven, at most
BUCKET_M = 2.0  # vertices lie up to 0.4 m apart along an extension


def allocate_tree(capacity: int, state_size: int) -> Tree:
    """Buffers for ``capacity`` vertices of ``state_size`` numbers a state."""
    states = np.empty((capacity, state_size))
    return Tree(
        states,
        np.empty((capacity, 2)),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.zeros(4, np.int64),
        np.zeros(1),
        allocate_buckets(),
        allocate_connection(state_size),
    )


@lean
def plant(tree: Tree, states: Floats, controls: Floats, bounds: Floats, bound_s: float) -> None:
    """Begin a new tree with a drive: ``states [n, S]`` from the root on, and ``controls [n - 1, 2]``.

    Beside its time it counts as nothing.
    """
    for i in range(states.shape[0]):
        for k in range(states.shape[1]):  # one by one, because assigning a row takes two seconds to compile
            tree.states[i, k] = states[i, k]
        tree.controls[i, 0] = controls[i - 1, 0] if i > 0 else 0.0
        tree.controls[i, 1] = controls[i - 1, 1] if i > 0 else 0.0
        tree.parents[i] = i - 1
        tree.depths[i] = i
        tree.gears[i] = gear_after(tree.gears[i - 1] if i > 0 else 0.0, states[i, 3])
        tree.extras[i] = 0.0
    tree.counts.fill(0)
    tree.bound[0] = bound_s
    prune(tree, states.shape[0], bounds)


@lean
def prune(tree: Tree, size: int, bounds: Floats) -> None:
    """Forget all but the first ``size`` vertices. Checks and expansions stay counted."""
    clear_buckets(tree.buckets, bounds, BUCKET_M)
    for i in range(size):
        tree.waypoints[i] = 0
        tree.spent[i] = 0
        put(tree.buckets, i, tree.states[i, 0], tree.states[i, 1])
    tree.counts[SIZE] = size
    tree.counts[GOAL_VERTEX] = -1


@inlined
def append(
    tree: Tree,
    parent: int,
    waypoint: int,
    state: State,
    control_1: float,
    control_2: float,
    depth: int,
    vehicle: Vehicle,
) -> int:
    """Add the state to which controls led from ``parent``, and return its vertex. The tree must have room."""
    new = tree.counts[SIZE]
    tree.counts[SIZE] += 1
    store(tree.states, new, state)
    tree.controls[new, 0] = control_1
    tree.controls[new, 1] = control_2
    tree.parents[new] = parent
    tree.depths[new] = depth
    before = tree.gears[parent]
    gear = gear_after(before, state[3])
    tree.gears[new] = gear
    tree.extras[new] = tree.extras[parent] + extra_cost(before, gear, vehicle.dt, vehicle)
    tree.waypoints[new] = waypoint
    tree.spent[new] = 0
    put(tree.buckets, new, state[0], state[1])
    return int(new)


@lean
def add_drive(tree: Tree, vertex: int, states: Floats, controls: Floats, vehicle: Vehicle) -> int:
    """Add a drive from a vertex on: ``controls [n, 2]`` lead to ``states [n, S]``, one to each.

    Returns the last vertex. The tree must have room.
    """
    waypoint = tree.waypoints[vertex]
    for i in range(controls.shape[0]):
        state, depth = load(states, i, vehicle), tree.depths[vertex] + 1
        vertex = append(tree, vertex, waypoint, state, controls[i, 0], controls[i, 1], depth, vehicle)
    return vertex


@inlined
def is_beyond(tree: Tree, parent: int, state: State, goal: Floats, vehicle: Vehicle) -> bool:
    """Whether no drive that goes on from a vertex to a state, a step away, stays within the bound."""
    seconds = (tree.depths[parent] + 1) * vehicle.dt + max(metres_to(state, goal), 0.0) / vehicle.max_speed
    if not pays(vehicle):
        return bool(seconds >= tree.bound[0])
    before = tree.gears[parent]
    extra = extra_cost(before, gear_after(before, state[3]), vehicle.dt, vehicle)
    return bool(seconds + tree.extras[parent] + extra >= tree.bound[0])


@lean
def connect_to_goal(
    tree: Tree, vertex: int, goal: Floats, top: float, vehicle: Vehicle, scene: Scene
) -> bool:
    """Drive from a vertex to the goal as if nothing were in the way, and add the drive if it is free.

    ``top`` is the largest speed in m/s. A vehicle that cannot reverse tries to turn more slowly first, and
    sharply, if that is quicker (``best_pace``).
    """
    store(tree.connection.states, 0, load(tree.states, vertex, vehicle))
    pace = best_pace(tree.connection, tree.gears[vertex], goal, top, vehicle)
    if _connect_with(tree, vertex, goal, pace, vehicle, scene):
        return True
    return pace < top and _connect_with(tree, vertex, goal, top, vehicle, scene)


@lean
def _connect_with(tree: Tree, vertex: int, goal: Floats, top: float, vehicle: Vehicle, scene: Scene) -> bool:
    """As ``connect_to_goal``, at one speed in arcs."""
    c = tree.connection
    state = load(tree.states, vertex, vehicle)
    store(c.states, 0, state)
    count = list_connections(c, tree.gears[vertex], goal, top, vehicle)
    x, y, heading = first_pose(state, top, vehicle)
    radius = radius_at(top, vehicle)
    depth = tree.depths[vertex]
    within_s = tree.bound[0] - depth * vehicle.dt - tree.extras[vertex]
    driven = 0
    for _ in range(OUTLINES):
        word = next_word(c, count, within_s)
        if word < 0 or driven == WORDS:
            return False
        if not outline_is_free(c.words[word], radius, x, y, heading, vehicle, scene):
            continue
        driven += 1
        steps = connect(c, word, goal, top, vehicle)
        if steps == 0:
            continue
        extra = extra_along(c.states[: steps + 1], tree.gears[vertex], vehicle) if pays(vehicle) else 0.0
        if (depth + steps) * vehicle.dt + tree.extras[vertex] + extra >= tree.bound[0]:
            continue
        if tree.counts[SIZE] + steps > tree.states.shape[0]:
            return False
        free = 1
        while free <= steps and state_is_free(load(c.states, free, vehicle), vehicle, scene):
            free += 1
        tree.counts[CHECKS] += min(free, steps)
        if free <= steps:
            continue
        states, controls = c.states[1 : steps + 1], c.controls[:steps]
        tree.counts[GOAL_VERTEX] = add_drive(tree, vertex, states, controls, vehicle)
        return True
    return False


@lean
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
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> int:
    """Drive from a vertex towards a target (x, y) in metres, and add the states before the first blocked one.

    A state that reaches the ``goal`` ends the extension. Along a ``lead [m, 2]``
    (empty for none) each state must be within ``tube_m`` of the segment to its next waypoint, which is passed
    within ``passing_m``. Returns the number of new vertices.
    """
    states = tree.states
    counts = tree.counts
    counts[EXPANSIONS] += 1
    state = load(states, vertex, vehicle)
    limit_1, limit_2 = control_limits(vehicle)
    waypoint = tree.waypoints[vertex]
    steered = uniform(rng) < settings.steer_probability
    spread = settings.most_steps - settings.least_steps + 1
    steps = int(length(target_x - state[0], target_y - state[1]) / settings.metres_a_step)
    steps += settings.least_steps + int(uniform(rng) * spread)
    desired_speed = (
        settings.slowest_share + (1.0 - settings.slowest_share) * uniform(rng)
    ) * vehicle.max_speed
    control_1 = (2.0 * uniform(rng) - 1.0) * limit_1
    control_2 = (2.0 * uniform(rng) - 1.0) * limit_2
    errors = NO_ERRORS
    connects = asks_for_more(goal)
    first = counts[SIZE]
    parent = vertex
    arrived = False
    for i in range(steps):
        if counts[SIZE] == states.shape[0]:
            break
        if steered:
            control_1, control_2, errors = steer(
                state, target_x, target_y, desired_speed, errors, i == 0, settings.gains, vehicle
            )
        driven_1, driven_2 = admissible(state, control_1, control_2, vehicle)
        state = step(state, driven_1, driven_2, vehicle)
        x = state[0]
        y = state[1]
        depth = tree.depths[parent] + 1
        if is_beyond(tree, parent, state, goal, vehicle):
            break
        counts[CHECKS] += 1
        if not state_is_free(state, vehicle, scene):
            break
        if lead.shape[0] > 0:
            while waypoint < lead.shape[0] - 1 and (
                length(lead[waypoint, 0] - x, lead[waypoint, 1] - y) < passing_m
            ):
                waypoint += 1
            before = max(waypoint - 1, 0)
            gap_x, gap_y = gap_to_segment(
                x, y, lead[before, 0], lead[before, 1], lead[waypoint, 0], lead[waypoint, 1]
            )
            if length(gap_x, gap_y) > tube_m:
                break
        parent = append(tree, parent, waypoint, state, driven_1, driven_2, depth, vehicle)
        if reaches(state, goal):
            counts[GOAL_VERTEX] = parent
            break
        if (
            connects
            and i % CONNECT_EVERY == CONNECT_EVERY - 1
            and metres_to(state, goal) < CONNECT_M
            and connect_to_goal(tree, parent, goal, word_speed(1.0, goal, vehicle), vehicle, scene)
        ):
            break
        arrived = length(x - target_x, y - target_y) < settings.arrival_m
        if arrived:
            break
    added = int(counts[SIZE] - first)
    if added < settings.least_added and not arrived and vertex > 0:
        tree.spent[vertex] = 1
        remove(tree.buckets, vertex, states[vertex, 0], states[vertex, 1])
    return added


@lean
def _trace(tree: Tree, states: Floats, controls: Floats) -> None:
    vertex = tree.counts[GOAL_VERTEX]
    for i in range(states.shape[0] - 1, -1, -1):
        for k in range(states.shape[1]):
            states[i, k] = tree.states[vertex, k]
        if i > 0:
            controls[i - 1, 0] = tree.controls[vertex, 0]
            controls[i - 1, 1] = tree.controls[vertex, 1]
        vertex = tree.parents[vertex]


def plan_to_goal(tree: Tree, dt: float) -> Plan:
    """Copy the plan from the root to the goal vertex."""
    steps = int(tree.depths[tree.counts[GOAL_VERTEX]])
    plan = Plan(np.empty((steps + 1, tree.states.shape[1])), np.empty((steps, 2)), dt)
    _trace(tree, plan.states, plan.controls)
    return plan
