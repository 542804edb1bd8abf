"""Which drives of a search are worth driving: of each kind the one estimated cheapest, of some kinds.

The first drive that a search finds is seldom of the kind that is quickest when it is improved. Of what kind a
drive is, its gears and turns say; improving it changes places and times, but not these.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.words import PARTS
from planners.search.manoeuvres.pose_tree import PoseTree, seconds_of_run
from planners.world.arrays import Floats, Indices
from planners.world.driving_cost import cost_of_second, gear_of
from planners.world.jit import inlined, lean
from planners.world.trigonometry import wrapped
from planners.world.vehicles.dynamics import top_speed
from planners.world.vehicles.vehicle import Vehicle

KEPT: Final = 2  # drives of different kinds: with a third, drives are no shorter by what it takes
STRAIGHT: Final = 0.3  # radians: a part in one gear that turns less leads straight on
MOST_LEGS: Final = 512


class Ways(NamedTuple):
    """The drives that a search has found, one of a kind."""

    costs: Floats  # [KEPT] by an estimate, in seconds; infinite: none
    kinds: Indices  # [KEPT]
    legs: Floats  # [MOST_LEGS, 2] scratch: gear (1 or -1), by how many radians it turns
    counts: Indices  # [1] how many legs there are
    last_cost: Floats  # [1] of the way that was looked at last
    last_kind: Indices  # [1]


def allocate_ways() -> Ways:
    """Buffers; nothing is found yet."""
    return Ways(
        np.full(KEPT, np.inf),
        np.full(KEPT, -1, np.int64),
        np.zeros((MOST_LEGS, 2)),
        np.zeros(1, np.int64),
        np.zeros(1),
        np.zeros(1, np.int64),
    )


def forget_ways(ways: Ways) -> None:
    """Nothing is found yet."""
    ways.costs.fill(np.inf)
    ways.kinds.fill(-1)


def keep_last(ways: Ways) -> int:
    """Keep the way that was looked at last; returns in which of the ``KEPT`` places."""
    same = np.flatnonzero(ways.kinds == ways.last_kind[0])
    at = int(same[0]) if len(same) else int(np.argmax(ways.costs))
    ways.costs[at], ways.kinds[at] = ways.last_cost[0], ways.last_kind[0]
    return at


@inlined
def _add_leg(ways: Ways, metres: float, turn: float) -> None:
    count = ways.counts[0]
    if count < MOST_LEGS and metres != 0.0:
        ways.legs[count, 0] = gear_of(metres)
        ways.legs[count, 1] = turn
        ways.counts[0] = count + 1


@inlined
def _add_legs_to_root(ways: Ways, tree: PoseTree, node: int, sign: float) -> None:
    """Add the legs from a node to the root of its tree; ``sign`` -1: of a tree out of the goal."""
    while node > 0:
        parent = tree.parents[node]
        turn = wrapped(tree.states[node, 2] - tree.states[parent, 2])
        _add_leg(ways, sign * tree.metres[node], sign * turn)
        node = parent


@inlined
def _list_legs_from_root(ways: Ways, before: PoseTree, last: int) -> None:
    """List the legs to a node of a tree out of the start, and no others."""
    ways.counts[0] = 0
    _add_legs_to_root(ways, before, last, 1.0)
    count = ways.counts[0]
    for i in range(count // 2):  # from the root now
        other = count - 1 - i
        for c in range(2):
            ways.legs[i, c], ways.legs[other, c] = ways.legs[other, c], ways.legs[i, c]


@inlined
def _kind(ways: Ways) -> int:
    """A number for the sequence of gears and turns of the legs."""
    kind = 0
    i = 0
    while i < ways.counts[0]:
        gear = ways.legs[i, 0]
        turned = 0.0
        while i < ways.counts[0] and ways.legs[i, 0] == gear:
            turned += ways.legs[i, 1]
            i += 1
        side = 0 if abs(turned) < STRAIGHT else (1 if turned > 0.0 else 2)
        kind = kind * 7 + 1 + side + (3 if gear > 0.0 else 0)
    return kind & 0x7FFFFFFFFFFFFFFF


@inlined
def _gear_to(tree: PoseTree, node: int) -> float:
    """The gear in which the way to a node of a start tree ends, 0 at its root."""
    if node == 0:
        return 0.0
    return gear_of(tree.metres[node])


@inlined
def _run(metres: float, gear: float, vehicle: Vehicle) -> float:
    """What a run costs, in seconds."""
    return cost_of_second(gear, vehicle) * seconds_of_run(metres, top_speed(gear, 0.0, vehicle), vehicle)


@inlined
def _joined_cost(
    tree: PoseTree, node: int, metres: float, gear: float, cost: float, vehicle: Vehicle
) -> float:
    """What a way costs that comes to a node of a goal tree at a ``cost``, its last run ``metres`` long."""
    whole = cost + tree.seconds[node] + tree.extras[node]
    if node > 0 and gear * tree.metres[node] > 0.0:
        whole += vehicle.costs.gear_change
    if node > 0 and gear * tree.metres[node] < 0.0:  # it drives on without a stop
        run = tree.runs[node]
        whole += _run(metres + run, gear, vehicle) - _run(metres, gear, vehicle) - _run(run, gear, vehicle)
    return float(whole)


@inlined
def dearest_kept(ways: Ways) -> float:
    """The cost below which a way is worth a look at its legs; infinite while a kind is missing."""
    worst = 0.0
    for k in range(KEPT):
        worst = max(worst, ways.costs[k])
    return float(worst)


@inlined
def _is_worth(ways: Ways, cost: float) -> bool:
    """Whether a cheap way, its legs in ``ways.legs``, is of a new kind, or the cheapest of its kind."""
    kind = _kind(ways)
    ways.last_kind[0] = kind
    ways.last_cost[0] = cost
    for k in range(KEPT):
        if ways.kinds[k] == kind:
            return bool(cost < ways.costs[k])
    return True


def last_is_worth(ways: Ways) -> bool:
    """Whether the way that was looked at last is worth keeping, now that its cost is known."""
    same = ways.costs[ways.kinds == ways.last_kind[0]]
    return bool(ways.last_cost[0] < (same.min() if len(same) else ways.costs.max()))


@lean
def word_is_worth(
    ways: Ways,
    before: PoseTree,
    last: int,
    word: Floats,
    radius: float,
    tree: PoseTree,
    node: int,
    vehicle: Vehicle,
) -> bool:
    """Whether a word ``[2 PARTS]`` is worth driving, with what leads to it and what follows it.

    It leads from node ``last`` of a tree out of the start, ``before``, to a ``node`` of one out of the goal.
    """
    metres = before.runs[last]
    gear = _gear_to(before, last)
    cost = before.seconds[last] + before.extras[last] - _run(metres, gear, vehicle)
    for k in range(PARTS):
        part = radius * word[PARTS + k]
        if part == 0.0:
            continue
        if gear * part < 0.0:
            cost += _run(metres, gear, vehicle) + vehicle.costs.gear_change
            metres = 0.0
        gear = gear_of(part)
        metres += abs(part)
    cost += _run(metres, gear, vehicle)
    cost = _joined_cost(tree, node, metres, gear, cost, vehicle)
    if cost >= dearest_kept(ways):
        return False
    _list_legs_from_root(ways, before, last)
    for k in range(PARTS):
        _add_leg(ways, radius * word[PARTS + k], word[k] * word[PARTS + k])
    _add_legs_to_root(ways, tree, node, -1.0)
    return _is_worth(ways, cost)


@lean
def meeting_is_worth(
    ways: Ways, before: PoseTree, last: int, tree: PoseTree, node: int, vehicle: Vehicle
) -> bool:
    """Whether a way is worth driving from a tree out of the start to a node of one out of the goal."""
    gear = _gear_to(before, last)
    cost = _joined_cost(
        tree, node, before.runs[last], gear, before.seconds[last] + before.extras[last], vehicle
    )
    if cost >= dearest_kept(ways):
        return False
    _list_legs_from_root(ways, before, last)
    _add_legs_to_root(ways, tree, node, -1.0)
    return _is_worth(ways, cost)


@lean
def take_arcs(ways: Ways, metres: Floats, turns: Floats) -> None:
    """Look at a way of arcs: ``metres [K]`` long, negative backwards, that turn by ``turns [K]`` radians."""
    ways.counts[0] = 0
    for k in range(metres.shape[0]):
        _add_leg(ways, metres[k], turns[k])
    ways.last_kind[0] = _kind(ways)
