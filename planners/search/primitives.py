"""Motion primitives, and the search that drives the one with the least estimate next, in compiled code.

A motion primitive drives for a fixed time towards one of a few speeds and one of a few steering angles (or
turn rates). States in the same cell of place, heading and speed count as one.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

from planners.search.connection.connection import word_speed
from planners.search.query import Query
from planners.search.structures import tree as trees
from planners.search.structures.cost_to_go import (
    BOTTOM,
    LEFT,
    PER_M,
    CostToGo,
    metres_to_go,
)
from planners.search.structures.frontier import (
    Frontier,
    clear_frontier,
    is_empty,
    pop,
    push,
    reach,
    was_reached,
)
from planners.search.structures.time_to_go import Ahead, seconds_to_go
from planners.world.arrays import Floats
from planners.world.driving_cost import extra_cost, gear_after, pays
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import asks_for_more, reaches
from planners.world.jit import inlined, lean
from planners.world.trigonometry import wrapped
from planners.world.vehicles.dynamics import (
    State,
    admissible,
    control_limits,
    curvature_of,
    load,
    sharpest_at,
    step,
    tightest_bend,
    turn_limit,
    turn_limit_at,
    turning_speed,
)
from planners.world.vehicles.vehicle import Vehicle

SHARES: Final = (0.0, 0.25, -0.25, 0.6, -0.6, 1.0, -1.0)  # of the largest steering angle or turn rate
GRIPPING: Final = 0.6  # of ``SHARES``: the one that is as sharp as lateral acceleration allows at the speed
SPEEDS: Final = (1.0, 0.5, -1.0, 0.0)  # shares of the largest speed; below 0 of the largest backwards
FARTHEST_M: Final = 12.0  # that a primitive leads, for those that turn in wide circles
LEAVES: Final = 1.2  # cells of heading that they turn by
CONNECT_M: Final = 15.0  # from the goal around obstacles: nearer vertices try to connect to it


class Lattice(NamedTuple):
    """One resolution of the search. The defaults are those of docs/planners.md."""

    steps: int = 5  # of a primitive
    speeds: int = 1  # how many of ``SPEEDS`` there are primitives for
    turn: float = 1.0  # the ``SHARES`` are multiplied by this
    cell: float = 1.0  # side of a cell, in those of the problem's window
    headings: int = 24  # cells of headings
    paces: int = 4  # cells of speeds
    greed: float = 2.0  # weight of the time to go; with 1 driving times are shorter and searches longer
    heading_s: float = 0.4  # time to go for each unit of 1 - cos of the angle to turn by
    pace: float = 1.0  # of a connection to the goal: the share of the largest speed
    late_s: float = 1.0  # time to go for each metre by which braking for the goal comes too late


@inlined
def controls_of(state: State, motion: int, lattice: Lattice, vehicle: Vehicle) -> tuple[float, float]:
    """The controls that lead towards a primitive's speed and steering."""
    share = SPEEDS[motion // len(SHARES)]
    speed = share * vehicle.max_speed if share > 0.0 else -share * vehicle.min_speed
    side = SHARES[motion % len(SHARES)]
    turn = min(max(lattice.turn * side, -1.0), 1.0) * turn_limit(vehicle)
    limit_1, limit_2 = control_limits(vehicle)
    control_1 = min(max((speed - state[3]) / vehicle.dt, -limit_1), limit_1)
    if vehicle.max_lateral_acceleration < math.inf and abs(side) < 1.0:  # only full turns are braked for
        sharpest = turn_limit_at(state[3] + vehicle.dt * control_1, vehicle)
        turn *= min(sharpest / (GRIPPING * turn_limit(vehicle)), 1.0)
    control_2 = min(max((turn - state[4]) / vehicle.dt, -limit_2), limit_2)
    return admissible(state, control_1, control_2, vehicle)


@inlined
def _key(state: State, go: CostToGo, lattice: Lattice, vehicle: Vehicle) -> int:
    """The cell of a state: 16 bits each for row and column, seven for the heading, three for the speed."""
    row = int((state[1] - go.frame[BOTTOM]) * go.frame[PER_M] / lattice.cell) & 0xFFFF
    column = int((state[0] - go.frame[LEFT]) * go.frame[PER_M] / lattice.cell) & 0xFFFF
    heading = int((wrapped(state[2]) + math.pi) * (lattice.headings / (2.0 * math.pi))) & 127
    share = (state[3] - vehicle.min_speed) / (vehicle.max_speed - vehicle.min_speed)
    pace = min(int(share * lattice.paces), lattice.paces - 1)
    return ((row << 16 | column) << 7 | heading) << 3 | pace


@lean
def open_vertex(
    tree: trees.Tree,
    vertex: int,
    frontier: Frontier,
    ahead: Ahead,
    lattice: Lattice,
    vehicle: Vehicle,
) -> None:
    """Let all primitives from a vertex wait. Each is checked for collisions when it is driven."""
    costs_more = pays(vehicle)
    for motion in range(len(SHARES) * lattice.speeds):
        state = load(tree.states, vertex, vehicle)
        gear, extra = tree.gears[vertex], tree.extras[vertex]
        for _ in range(lattice.steps):
            control_1, control_2 = controls_of(state, motion, lattice, vehicle)
            state = step(state, control_1, control_2, vehicle)
            if costs_more:
                before = gear
                gear = gear_after(before, state[3])
                extra += extra_cost(before, gear, vehicle.dt, vehicle)
        if not was_reached(frontier, _key(state, ahead.go, lattice, vehicle)):
            spent = (tree.depths[vertex] + lattice.steps) * vehicle.dt + extra
            left = seconds_to_go(state, ahead, lattice.heading_s, lattice.late_s, vehicle)
            push(frontier, spent + lattice.greed * left, vertex, motion)


@lean
def begin_lattice(
    tree: trees.Tree, frontier: Frontier, ahead: Ahead, lattice: Lattice, vehicle: Vehicle
) -> None:
    """Begin a search from the vertices that the tree has: its root, or a drive that is given."""
    clear_frontier(frontier)
    last = tree.counts[trees.SIZE] - 1
    open_vertex(tree, last, frontier, ahead, lattice, vehicle)
    for vertex in range(0, last, lattice.steps):
        open_vertex(tree, vertex, frontier, ahead, lattice, vehicle)


@lean
def drive_primitive(
    tree: trees.Tree, vertex: int, motion: int, goal: Floats, lattice: Lattice, vehicle: Vehicle, scene: Scene
) -> int:
    """Add the states of a primitive to the tree, and return the last; -1: blocked, or too costly."""
    counts = tree.counts
    state = load(tree.states, vertex, vehicle)
    parent = vertex
    for _ in range(lattice.steps):
        control_1, control_2 = controls_of(state, motion, lattice, vehicle)
        state = step(state, control_1, control_2, vehicle)
        if trees.is_beyond(tree, parent, state, goal, vehicle):
            return -1
        counts[trees.CHECKS] += 1
        if not state_is_free(state, vehicle, scene):
            return -1
        depth = tree.depths[parent] + 1
        parent = trees.append(tree, parent, 0, state, control_1, control_2, depth, vehicle)
        if reaches(state, goal):
            counts[trees.GOAL_VERTEX] = parent
            break
    return parent


@lean
def grow_lattice(
    tree: trees.Tree,
    goal: Floats,
    until: int,
    frontier: Frontier,
    ahead: Ahead,
    lattice: Lattice,
    vehicle: Vehicle,
    scene: Scene,
) -> None:
    """Drive the primitive with the least estimate until solved, nothing is left, or ``until`` expansions."""
    counts = tree.counts
    connects = asks_for_more(goal)
    top = word_speed(lattice.pace, goal, vehicle)
    if connects and trees.connect_to_goal(tree, 0, goal, top, vehicle, scene):
        return
    while (
        counts[trees.EXPANSIONS] < until
        and counts[trees.SIZE] + lattice.steps <= tree.states.shape[0]
        and not is_empty(frontier)
    ):
        counts[trees.EXPANSIONS] += 1
        vertex, motion = pop(frontier)
        last = drive_primitive(tree, vertex, motion, goal, lattice, vehicle, scene)
        if counts[trees.GOAL_VERTEX] >= 0:
            return
        if last >= 0:
            key = _key(load(tree.states, last, vehicle), ahead.go, lattice, vehicle)
            if not was_reached(frontier, key):
                reach(frontier, key)
                if (
                    connects
                    and metres_to_go(tree.states[last, 0], tree.states[last, 1], ahead.go) < CONNECT_M
                    and trees.connect_to_goal(tree, last, goal, top, vehicle, scene)
                ):
                    return
                open_vertex(tree, last, frontier, ahead, lattice, vehicle)


@lru_cache(64)
def paced(lattice: Lattice, vehicle: Vehicle, sharpest: float) -> Lattice:
    """The lattice for a vehicle of any speed: a primitive leads as far as the car's, 2 m at full speed.

    A vehicle that turns in wide circles drives on until it has left its cell of heading, if that is not too
    far: else turning and driving straight on end in one cell, and only one of them counts. Speeds are told
    apart more finely if two primitives one after another would not get from one to the next. A vehicle that
    turns on the spot would turn round in each primitive: at full speed none bends more than ``sharpest``
    (1/m). Where lateral acceleration is limited that does so already.
    """
    top = vehicle.max_speed
    unlimited = vehicle._replace(max_lateral_acceleration=math.inf)
    sharpest_bend = curvature_of(tightest_bend(top, unlimited), unlimited)
    leaving = LEAVES * math.tau / (lattice.headings * sharpest_bend)  # metres
    metres = max(0.4 * lattice.steps, min(leaving, FARTHEST_M))
    seconds = 2.0 / top
    faster = 2.0 * seconds * control_limits(vehicle)[0]
    paces = lattice.paces
    while faster * paces < top - vehicle.min_speed and paces < 8:
        paces += 1
    steps = round(metres / (top * vehicle.dt))
    slower = top / turning_speed(vehicle)  # times as long as at full speed a turn takes
    turn = lattice.turn
    if vehicle.max_lateral_acceleration == math.inf:
        turn *= min(sharpest_at(top, sharpest * top * top, vehicle) / turn_limit(vehicle), 1.0)
    return lattice._replace(steps=max(steps, 1), paces=paces, turn=turn, heading_s=slower * lattice.heading_s)


def varied(lattice: Lattice, greed: float, query: Query) -> Lattice:
    """Another lattice, drawn at random: a search for a better plan than before must look at other states."""
    steps = max(lattice.steps + int(3.0 * query.rng.random()) - 1, 1)
    return lattice._replace(greed=greed, steps=steps, turn=lattice.turn * (0.7 + 0.6 * query.rng.random()))
