"""The tree of ways out of a root: the start, or a goal pose, into which they lead with time reversed."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.profile import run_seconds
from planners.search.structures.frontier import Frontier, allocate_frontier, clear_frontier, push
from planners.world.arrays import Floats, Indices, Integers
from planners.world.driving_cost import extra_cost
from planners.world.goal import HEADING, HITCHES, X, Y
from planners.world.jit import inlined, lean
from planners.world.trigonometry import wrapped
from planners.world.vehicles.dynamics import (
    State,
    bend_rate,
    control_limits,
    load,
    store,
    top_speed,
    turn_limit,
)
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

NODES: Final = 1 << 17
PLACES: Final = 1 << 16
PLACE: Final = 0.3  # side of a place, in the first body's length ...
PLACE_HEADINGS: Final = 36  # ... how many headings are told apart there ...
PLACE_HITCHES: Final = 3.0  # ... and cells of a hitch, a radian
REGIONS: Final = 1 << 14
REGION: Final = 1.0  # side of a region, in the first body's length ...
REGION_HEADINGS: Final = 8  # ... and how many headings are told apart there; of each hitch three parts
_FIBONACCI: Final = 0x9E3779B1
HITCH_CELLS: Final = 5.0  # of hitches, a radian
MOST_HEADINGS: Final = 1024  # cells of headings: so many a key has room for
ROLLING: Final = 0.5  # of the time for turning the wheels at rest, if that is done while driving on
# indices into PoseTree.counts
SIZE, CHECKS, LAST = range(3)


class PoseTree(NamedTuple):
    """Poses at rest, each joined by an arc to the one that it was reached from; the first is the root."""

    states: Floats  # [NODES, S]
    parents: Indices  # [NODES]
    bends: Floats  # [NODES] of the arc between a node and its parent
    metres: Floats  # [NODES] and its length; negative if it leads backwards out of the root
    runs: Floats  # [NODES] metres that are driven in the gear of that arc until it changes
    seconds: Floats  # [NODES] estimated driving time between the node and the root
    extras: Floats  # [NODES] what that drive costs beside its time, in seconds
    known: Indices  # [NODES] the part of the known endings that leads to the parent; -1: an arc
    places: Integers  # [PLACES] a node in the place that falls into this slot; -1: none
    opened: Integers  # [REGIONS] how many nodes of the region that falls into this slot were opened
    crowds: Integers  # [NODES] how many of those a waiting node's estimate counts
    frontier: Frontier
    counts: Indices  # [3] nodes; looks at obstacles; the node that was opened last


def allocate_pose_tree(state_size: int) -> PoseTree:
    """Buffers for states of ``state_size`` numbers."""
    return PoseTree(
        np.zeros((NODES, state_size)),
        np.zeros(NODES, np.int64),
        np.zeros(NODES),
        np.zeros(NODES),
        np.zeros(NODES),
        np.zeros(NODES),
        np.zeros(NODES),
        np.zeros(NODES, np.int64),
        np.zeros(PLACES, np.int32),
        np.zeros(REGIONS, np.int32),
        np.zeros(NODES, np.int32),
        allocate_frontier(),
        np.zeros(3, np.int64),
    )


def pose_of(goal: Floats, size: int) -> Floats:
    """The state ``[size]`` that a goal, that of ``goal_of``, asks for; what it does not ask for is zero."""
    state = np.zeros(size)
    state[[0, 1, 2]] = goal[[X, Y, HEADING]]
    state[FIRST_HITCH:] = goal[HITCHES::2] if len(goal) > HITCHES else 0.0
    return state


@lean
def plant_root(tree: PoseTree, root: Floats) -> None:
    """Begin a tree at a state ``[S]``."""
    clear_frontier(tree.frontier)
    tree.places.fill(-1)
    tree.opened.fill(0)
    tree.crowds[0] = 0
    push(tree.frontier, 0.0, 0, 0)
    tree.counts[SIZE] = 1
    tree.counts[LAST] = 0
    for k in range(tree.states.shape[1]):
        tree.states[0, k] = root[k]
    tree.parents[0] = -1
    tree.bends[0] = 0.0
    tree.metres[0] = 0.0
    tree.runs[0] = 0.0
    tree.seconds[0] = 0.0
    tree.extras[0] = 0.0
    tree.known[0] = 0  # the root is no end of an arc


@inlined
def list_links(tree: PoseTree, node: int, chain: Indices) -> int:
    """List the nodes from behind the root to ``node`` in ``chain``; returns their number, -1 without room."""
    links = 0
    each = node
    while each > 0:
        links += 1
        each = tree.parents[each]
    if links > chain.shape[0]:
        return -1
    each = node
    for k in range(links - 1, -1, -1):
        chain[k] = each
        each = tree.parents[each]
    return links


@inlined
def seconds_of_run(metres: float, top: float, vehicle: Vehicle) -> float:
    """The time to drive some metres from rest to rest, no faster than ``top`` (m/s), in seconds."""
    return run_seconds(metres, 0.0, 0.0, top, control_limits(vehicle)[0])


@inlined
def seconds_after(
    tree: PoseTree, node: int, bend: float, metres: float, outgoing: Vehicle, vehicle: Vehicle
) -> tuple[float, float]:
    """The time between the root and the end of an arc out of a node, and what it costs beside, in seconds.

    ``metres`` and ``outgoing`` are as in the tree: the vehicle as it drives out of the root.
    """
    top = top_speed(metres, bend, outgoing)
    turning = abs(bend - tree.bends[node]) / bend_rate(vehicle.max_speed, vehicle)
    turning = min(turning, 2.0 * turn_limit(vehicle) / control_limits(vehicle)[1])  # in tight bends
    seconds = tree.seconds[node]
    if tree.metres[node] * metres > 0.0:
        run = tree.runs[node]
        driving = seconds_of_run(run + abs(metres), top, vehicle) - seconds_of_run(run, top, vehicle)
        seconds += driving
        seconds += ROLLING * turning
    else:
        driving = seconds_of_run(abs(metres), top, vehicle)
        seconds += driving + (turning if node > 0 else 0.0)
    extra = extra_cost(tree.metres[node], metres, driving, outgoing)
    return float(seconds), float(tree.extras[node] + extra)


@inlined
def add_node(
    tree: PoseTree, parent: int, state: State, bend: float, metres: float, seconds: float, extra: float
) -> int:
    """Add the end of an arc out of a node, and return its number. The tree must have room."""
    new = tree.counts[SIZE]
    tree.counts[SIZE] += 1
    store(tree.states, new, state)
    tree.states[new, 3] = 0.0
    tree.states[new, 4] = 0.0
    tree.parents[new] = parent
    tree.bends[new] = bend
    tree.metres[new] = metres
    tree.seconds[new] = seconds
    tree.extras[new] = extra
    tree.known[new] = -1
    tree.crowds[new] = 0
    same = tree.metres[parent] * metres > 0.0
    tree.runs[new] = abs(metres) + (tree.runs[parent] if same else 0.0)
    return int(new)


@inlined
def add_known_node(
    tree: PoseTree,
    parent: int,
    state: State,
    bend: float,
    metres: float,
    seconds: float,
    extra: float,
    part: int,
) -> int:
    """Add the beginning of a part of the known endings, as ``add_node`` does."""
    new = add_node(tree, parent, state, bend, metres, seconds, extra)
    tree.known[new] = part
    return new


@inlined
def _square_of(state: State, x: float, y: float, side: float) -> int:
    """The square of a position, seen from (x, y): in 32 bits its row and, in the lower 16, its column."""
    row = math.floor((state[1] - y) / side) & 0xFFFF
    column = math.floor((state[0] - x) / side) & 0xFFFF
    return int(row << 16 | column)


@inlined
def _sector_of(state: State, headings: int) -> int:
    """Which of so many ``headings`` a state has; by rounding it may be one more than the last."""
    return int((wrapped(state[2]) + math.pi) * (headings / (2.0 * math.pi)))


@inlined
def _slot_of(key: int, slots: int) -> int:
    """Which of the slots, a power of two of them, a key falls into: bits from the middle of a product."""
    return (key * _FIBONACCI >> 20) & (slots - 1)


@inlined
def cell_of(state: State, gear: float, tree: PoseTree, cell: float, headings: int, vehicle: Vehicle) -> int:
    """The cell of a pose that is left in a gear, seen from the root; with its hitches.

    Its bits are, from the highest: 5 for each hitch, 32 for the square, 10 for the heading, 1 for the gear.
    """
    hitches = 0
    for k in range(FIRST_HITCH, len(state)):
        hitches = hitches << 5 | (math.floor(state[k] * HITCH_CELLS) & 31)
    square = _square_of(state, tree.states[0, 0], tree.states[0, 1], cell)
    heading = _sector_of(state, headings) % MOST_HEADINGS
    return int((hitches << 32 | square) << 11 | heading << 1 | (1 if gear > 0.0 else 0))


@inlined
def place_of(state: State, origin: Floats, vehicle: Vehicle) -> int:
    """The place of a pose with its hitches, seen from a corner ``origin [2]``: where two trees may meet.

    Its bits are, from the highest: 32 for the square, 7 for the heading, 5 for each hitch.
    """
    square = _square_of(state, origin[0], origin[1], PLACE * (vehicle.front + vehicle.rear))
    key = square << 7 | _sector_of(state, PLACE_HEADINGS)
    for k in range(FIRST_HITCH, len(state)):
        key = key << 5 | (math.floor(state[k] * PLACE_HITCHES) & 31)
    return int(key)


@inlined
def region_of(state: State, tree: PoseTree, vehicle: Vehicle) -> int:
    """The slot in ``opened`` of a region: a length, an eighth of all headings, a radian of each hitch.

    The bits of its key are, from the highest: 32 for the square, 4 for the heading, 3 for each hitch.
    """
    side = REGION * (vehicle.front + vehicle.rear)
    square = _square_of(state, tree.states[0, 0], tree.states[0, 1], side)
    key = square << 4 | _sector_of(state, REGION_HEADINGS)
    for k in range(FIRST_HITCH, len(state)):
        key = key << 3 | (math.floor(state[k] + 0.5) & 7)
    return _slot_of(key, REGIONS)


@inlined
def mark_place(tree: PoseTree, node: int, origin: Floats, vehicle: Vehicle) -> None:
    """Remember a node for its place, unless there is one."""
    place = place_of(load(tree.states, node, vehicle), origin, vehicle)
    slot = _slot_of(place, PLACES)
    known = tree.places[slot]
    if known < 0 or place_of(load(tree.states, known, vehicle), origin, vehicle) != place:
        tree.places[slot] = node


@inlined
def node_near(tree: PoseTree, state: State, origin: Floats, vehicle: Vehicle) -> int:
    """A node in the place of a state; -1 if none is known."""
    place = place_of(state, origin, vehicle)
    node = tree.places[_slot_of(place, PLACES)]
    if node >= 0 and place_of(load(tree.states, node, vehicle), origin, vehicle) == place:
        return int(node)
    return -1
