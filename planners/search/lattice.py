"""Best-first search over motion primitives (Pivtoraiko and Kelly 2005; Dolgov 2008: hybrid A*).

A motion primitive drives for a fixed time towards one of a few speeds and one of a few steering angles (or
turn rates). Of all primitives from all states reached, the one with the least driving time is driven next:
the time so far, and the time to go, which is estimated from the distance over the grid. States in the same
cell of place, heading and speed count as one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

from planners.search.guides.sampling import uniform
from planners.search.manoeuvres.manoeuvring import Manoeuvring, suits
from planners.search.outcome import Outcome
from planners.search.query import Query
from planners.search.rrt import towards_anywhere
from planners.search.search_loop import attempt
from planners.search.structures import tree as trees
from planners.search.structures.cost_to_go import (
    BOTTOM,
    LEFT,
    PER_M,
    CostToGo,
    allocate_cost_to_go,
    fill_cost_to_go,
    metres_to_go,
)
from planners.search.structures.frontier import (
    Frontier,
    allocate_frontier,
    clear_frontier,
    is_empty,
    pop,
    push,
    reach,
    was_reached,
)
from planners.search.structures.time_to_go import NO_TABLE, Ahead, ahead_of, seconds_to_go
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.geometry.occupancy import drawing_of, window_of
from planners.world.goal import RADIUS, X, Y, asks_for_more, metres_to, place, reaches
from planners.world.jit import inlined, lean
from planners.world.problem import is_canonical
from planners.world.trigonometry import wrapped
from planners.world.vehicles.dynamics import State, admissible, control_limits, load, step, turn_limit
from planners.world.vehicles.vehicle import Vehicle

SHARES: Final = (0.0, 0.25, -0.25, 0.6, -0.6, 1.0, -1.0)  # of the largest steering angle or turn rate
SPEEDS: Final = (1.0, 0.5, -1.0, 0.0)  # shares of the largest speed; below 0 of the largest backwards
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


class LatticeSettings(NamedTuple):
    """Defaults of docs/planners.md, Lattice."""

    levels: tuple[Lattice, ...] = (
        Lattice(),
        Lattice(steps=4, speeds=3, cell=0.5, headings=32),
        Lattice(steps=3, speeds=3, cell=0.25, headings=48),
    )  # one after another, each when the one before has nothing left to drive or has taken too long
    anywhere: tuple[Lattice, ...] = (
        Lattice(steps=6, headings=16, heading_s=0.2),
        Lattice(steps=10, speeds=3),  # long, so that going back leaves the cell
        Lattice(speeds=4),
        Lattice(steps=4, speeds=4, cell=0.5, headings=32, pace=0.5),
        Lattice(steps=3, speeds=4, cell=0.25, headings=48, pace=0.25),
    )  # the same for problems that are not canonical; where a speed is asked at the goal, without two
    improving_greed: float = 1.2  # where only a plan better than a given one will do
    restart_after: int = 400  # expansions; every second trial is grown by RRT
    alone: int = 256  # expansions before manoeuvres are searched for as well, unless the goal is tight
    by_turns: tuple[int, int] = (64, 16)  # then expansions of this search, and of that for manoeuvres ...
    if_tight: tuple[int, int] = (16, 48)  # ... or so many, and with trailers
    head_start: int = 300  # expansions of the search that aims at known endings, if the goal is tight


NOWHERE = place(0.0, 0.0, 0.0)


@inlined
def _controls(state: State, motion: int, lattice: Lattice, vehicle: Vehicle) -> tuple[float, float]:
    """The controls that lead towards a primitive's speed and steering."""
    share = SPEEDS[motion // len(SHARES)]
    speed = share * vehicle.max_speed if share > 0.0 else -share * vehicle.min_speed
    turn = min(max(lattice.turn * SHARES[motion % len(SHARES)], -1.0), 1.0) * turn_limit(vehicle)
    limit_1, limit_2 = control_limits(vehicle)
    control_1 = min(max((speed - state[3]) / vehicle.dt, -limit_1), limit_1)
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
    for motion in range(len(SHARES) * lattice.speeds):
        state = load(tree.states, vertex, vehicle)
        for _ in range(lattice.steps):
            control_1, control_2 = _controls(state, motion, lattice, vehicle)
            state = step(state, control_1, control_2, vehicle)
        if not was_reached(frontier, _key(state, ahead.go, lattice, vehicle)):
            spent = (tree.depths[vertex] + lattice.steps) * vehicle.dt
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
    """Add the states of a primitive to the tree, and return the last; -1 if one is blocked or too late."""
    counts = tree.counts
    state = load(tree.states, vertex, vehicle)
    parent = vertex
    for _ in range(lattice.steps):
        control_1, control_2 = _controls(state, motion, lattice, vehicle)
        state = step(state, control_1, control_2, vehicle)
        depth = tree.depths[parent] + 1
        if depth * vehicle.dt + max(metres_to(state, goal), 0.0) / vehicle.max_speed >= tree.bound[0]:
            return -1
        counts[trees.CHECKS] += 1
        if not state_is_free(state, vehicle, scene):
            return -1
        parent = trees.append(tree, parent, 0, state, control_1, control_2, depth)
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
    top = lattice.pace * vehicle.max_speed
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


def paced(lattice: Lattice, vehicle: Vehicle) -> Lattice:
    """The lattice for a vehicle of any speed: a primitive leads as far as the car's, 2 m at full speed.

    Speeds are told apart more finely if two primitives one after another would not get from one to the next.
    """
    seconds = 2.0 / vehicle.max_speed
    faster = 2.0 * seconds * control_limits(vehicle)[0]
    paces = lattice.paces
    while faster * paces < vehicle.max_speed - vehicle.min_speed and paces < 8:
        paces += 1
    steps = round(lattice.steps * seconds / (5.0 * vehicle.dt))
    return lattice._replace(steps=max(steps, 1), paces=paces)


def _varied(lattice: Lattice, greed: float, query: Query) -> Lattice:
    """Another lattice, drawn at random: whoever wants a better plan than before must look at other states."""
    bits = query.rng.bit_generator
    return lattice._replace(
        greed=greed, steps=lattice.steps + int(3.0 * uniform(bits)) - 1, turn=0.7 + 0.6 * uniform(bits)
    )


def lattice(query: Query, settings: LatticeSettings) -> Outcome:
    """Plan from the problem's start to its goal. A guide is not looked at."""
    go = query.workspace.buffers(allocate_cost_to_go)
    frontier = query.workspace.buffers(allocate_frontier)
    vehicle, scene = query.vehicle, query.scene
    improving = math.isfinite(query.limits.bound_s)
    levels = settings.levels if is_canonical(query.problem) else settings.anywhere
    arrival = query.problem.arrival
    if arrival is not None and arrival.most_speed < vehicle.max_speed:
        levels = levels[2:]
    level, tried = levels[0], 0
    ahead = Ahead(go, NOWHERE, NO_TABLE)
    manoeuvring: Manoeuvring | None = None
    joining: Manoeuvring | None = None
    joined = False

    def prepare(tree: trees.Tree, goal: Floats, trial: int) -> None:
        nonlocal level, tried, ahead, manoeuvring, joining
        if trial == 0:
            ahead = ahead_of(goal, go, vehicle)
            occupied = query.occupied
            if occupied is None:
                occupied = drawing_of(query.problem, query.workspace).occupied
            fill_cost_to_go(occupied, goal[X], goal[Y], goal[RADIUS], window_of(query.problem), go)
            if suits(goal, vehicle):
                manoeuvring = Manoeuvring(query, goal, occupied)
                if query.endings is not None:
                    joining = manoeuvring.joining(query, query.endings)
        level = paced(levels[min(tried, len(levels) - 1)], vehicle)
        tried += 1
        if improving:
            level = _varied(level, settings.improving_greed, query)
        begin_lattice(tree, frontier, ahead, level, vehicle)

    def grow(tree: trees.Tree, goal: Floats, until: int) -> None:
        counts = tree.counts
        if manoeuvring is None:
            grow_lattice(tree, goal, until, frontier, ahead, level, vehicle, scene)
            return
        hard = manoeuvring.is_tight or manoeuvring.meets
        here, there = settings.if_tight if hard else settings.by_turns
        now = here
        if counts[trees.EXPANSIONS] == 0:
            now = 0 if manoeuvring.is_tight else settings.alone
        while counts[trees.GOAL_VERTEX] < 0 and counts[trees.EXPANSIONS] < until:
            if join(tree, manoeuvring.is_tight):
                return
            before = int(counts[trees.EXPANSIONS])
            grow_lattice(tree, goal, min(before + now, until), frontier, ahead, level, vehicle, scene)
            if counts[trees.GOAL_VERTEX] < 0:
                expansions, checks = manoeuvring.expansions, manoeuvring.checks
                manoeuvring.advance(tree, min(there, until - int(counts[trees.EXPANSIONS])))
                counts[trees.EXPANSIONS] += manoeuvring.expansions - expansions
                counts[trees.CHECKS] += manoeuvring.checks - checks
            if counts[trees.EXPANSIONS] == before:
                return
            now = here

    def join(tree: trees.Tree, is_tight: bool) -> bool:
        """Aim at known endings with as much work as all else has had: what is found alone is found still."""
        nonlocal joined
        if joining is None:
            return False
        more = int(tree.counts[trees.EXPANSIONS]) + (settings.head_start if is_tight else 0)
        found = joining.advance(tree, more - joining.expansions)
        joined = found and joining.joined
        return found

    explore_from = 2 if levels == settings.anywhere else 1  # RRT does not reverse, as the second level does
    outcome = attempt(
        query, settings.restart_after, prepare, grow, towards_anywhere(query), explore_from=explore_from
    )
    if joining is None:
        return outcome
    return replace(
        outcome,
        expansions=outcome.expansions + joining.expansions,
        collision_checks=outcome.collision_checks + joining.checks,
        joined=joined,
    )
