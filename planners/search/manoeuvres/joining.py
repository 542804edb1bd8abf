"""Joins the start to a node of a goal tree by arcs that also leave the trailers as the node has them.

A word of turns leads the first body to the node and the trailers somewhere. Its arcs are driven a little more
or less sharply, a little farther or less far, until all of the state is that of the node (Gauss-Newton with
least changes).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.words import PARTS
from planners.search.manoeuvres.arcs import COARSE, leap_of, leapt, stride_along, stride_in, stride_of
from planners.world.arrays import Floats, Indices
from planners.world.driving_cost import gear_of
from planners.world.geometry.collision import Scene
from planners.world.jit import inlined, lean
from planners.world.trigonometry import wrapped
from planners.world.vehicles.dynamics import (
    State,
    bend_with,
    load,
    numbers_of,
    store,
    tightest_bend,
    turning_speed,
)
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

MOST_ARCS: Final = 2 * PARTS
MOST_CHAIN: Final = 256
ROUNDS: Final = 16
BEND_SHARE: Final = 0.2  # of the tightest bend: how much an arc's bend changes as readily as ...
LENGTH_SHARE: Final = 0.2  # ... its length does, by this share of the first body's length
LARGEST: Final = 1.0  # change of a round, in these shares
NUDGE: Final = 1e-5  # of a bend (rad) and of a length (m), to see what they do
DAMPING: Final = 1e-7
EXACT: Final = 1e-5  # metres and radians
WIDEST: Final = 0.5  # radians or metres: what is farther off is not corrected
# indices into Join.counts
ARCS, BEFORE = range(2)


class Join(NamedTuple):
    """Arcs from the start to a node, and the buffers that correct them."""

    arcs: Floats  # [3, MOST_ARCS] gear (1 or -1), bend, length in metres
    ends: Floats  # [3, S] where the arcs before the meeting lead; where all should; where those after begin
    ways: Floats  # [MOST_ARCS, S] where each arc leads: those before the meeting on, those after it back
    effects: Floats  # [6, 2 MOST_ARCS] of bends and lengths on what is missing: x, y, heading, hitches
    bent: Floats  # [1, S] where an arc begins, with one hitch bent a little
    carried: Floats  # [2, 3, 3] what hitches at the end of an arc do at the meeting
    squares: Floats  # [6, 7] the equations of a correction
    free: Floats  # [2 MOST_ARCS] 0 for what the last round would have moved beyond its limit, else 1
    chain: Indices  # [MOST_CHAIN] nodes between a node of a tree and its root
    base: Floats  # [1, S] where the arcs begin
    counts: Indices  # [2] how many arcs there are; of these before the meeting


def allocate_join(state_size: int) -> Join:
    """Buffers for states of ``state_size`` numbers."""
    return Join(
        np.zeros((3, MOST_ARCS)),
        np.zeros((3, state_size)),
        np.zeros((MOST_ARCS, state_size)),
        np.zeros((6, 2 * MOST_ARCS)),
        np.zeros((1, state_size)),
        np.zeros((2, 3, 3)),
        np.zeros((6, 7)),
        np.zeros(2 * MOST_ARCS),
        np.zeros(MOST_CHAIN, np.int64),
        np.zeros((1, state_size)),
        np.zeros(2, np.int64),
    )


@inlined
def _along(state: State, gear: float, bend: float, metres: float, stride: float, vehicle: Vehicle) -> State:
    """The end of an arc, whatever is in the way, in steps of ``COARSE`` strides."""
    count = math.ceil(metres / (COARSE * stride))
    if count == 0:
        return state
    speed = gear * metres / (count * vehicle.dt)
    leap = leap_of(state, speed, bend, vehicle)
    for _ in range(count):
        state = leapt(state, leap, vehicle)
    return state


@inlined
def _beginning(start: Floats, join: Join, k: int, vehicle: Vehicle) -> State:
    """Where arc number ``k`` begins: one after the meeting at its end, as it is followed back."""
    if k < join.counts[BEFORE]:
        return load(start, 0, vehicle) if k == 0 else load(join.ways, k - 1, vehicle)
    return load(join.ends, 1, vehicle) if k == join.counts[ARCS] - 1 else load(join.ways, k + 1, vehicle)


@inlined
def _led(state: State, join: Join, k: int, bend: float, metres: float, vehicle: Vehicle) -> State:
    """Where arc number ``k`` leads from a state, with so much more bend and length."""
    gear = join.arcs[0, k]
    sign = 1.0 if k < join.counts[BEFORE] else -1.0
    stride = stride_of(gear, vehicle)
    return _along(state, sign * gear, join.arcs[1, k] + bend, join.arcs[2, k] + metres, stride, vehicle)


@lean
def follow(start: Floats, join: Join, vehicle: Vehicle) -> None:
    """Find where each arc leads, and so both ends at the meeting."""
    before, arcs = join.counts[BEFORE], join.counts[ARCS]
    for i in range(arcs):
        k = i if i < before else arcs - 1 - (i - before)
        store(join.ways, k, _led(_beginning(start, join, k, vehicle), join, k, 0.0, 0.0, vehicle))
    store(join.ends, 0, load(join.ways, before - 1, vehicle) if before > 0 else load(start, 0, vehicle))
    store(join.ends, 2, load(join.ways, before, vehicle) if before < arcs else load(join.ends, 1, vehicle))


@inlined
def _carry(join: Join, k: int, column: int, after: State) -> None:
    """Note in a column how the pose at the meeting changes if arc ``k`` leads to ``after``."""
    end = 0 if k < join.counts[BEFORE] else 2
    turned = after[2] - join.ways[k, 2]
    join.effects[0, column] = after[0] - join.ways[k, 0] - turned * (join.ends[end, 1] - join.ways[k, 1])
    join.effects[1, column] = after[1] - join.ways[k, 1] + turned * (join.ends[end, 0] - join.ways[k, 0])
    join.effects[2, column] = turned


@inlined
def _carried_hitch(join: Join, k: int, row: int, after: State, hitches: int) -> float:
    """How hitch ``row`` at the meeting changes if arc ``k`` leads to ``after``."""
    total = 0.0
    for j in range(hitches):
        total += join.carried[0, row, j] * (after[FIRST_HITCH + j] - join.ways[k, FIRST_HITCH + j])
    return total


@lean
def find_effects(start: Floats, join: Join, vehicle: Vehicle) -> None:
    """Find what more bend and length of each arc do at the meeting, after ``follow``.

    Each arc is nudged alone: what follows it turns and moves as a whole, and the effect of its hitches is
    carried on from arc to arc.
    """
    before, arcs = join.counts[BEFORE], join.counts[ARCS]
    hitches = numbers_of(start, vehicle) - FIRST_HITCH
    for i in range(arcs):
        k = before - 1 - i if i < before else i  # from the meeting on, to either side
        if i in (0, before):
            for row in range(hitches):
                for j in range(hitches):
                    join.carried[0, row, j] = 1.0 if row == j else 0.0
        sign = 1.0 if k < before else -1.0
        begin = _beginning(start, join, k, vehicle)
        for which in range(2):
            bend, metres = (NUDGE, 0.0) if which == 0 else (0.0, NUDGE)
            after = _led(begin, join, k, bend, metres, vehicle)
            column = 2 * k + which
            _carry(join, k, column, after)
            for row in range(hitches):
                join.effects[3 + row, column] = _carried_hitch(join, k, row, after, hitches)
            for row in range(3 + hitches):
                join.effects[row, column] *= sign / NUDGE
        for j in range(hitches):
            store(join.bent, 0, begin)
            join.bent[0, FIRST_HITCH + j] += NUDGE
            after = _led(load(join.bent, 0, vehicle), join, k, 0.0, 0.0, vehicle)
            for row in range(hitches):
                join.carried[1, row, j] = _carried_hitch(join, k, row, after, hitches) / NUDGE
        for row in range(hitches):
            for j in range(hitches):
                join.carried[0, row, j] = join.carried[1, row, j]


@inlined
def _off(join: Join, row: int) -> float:
    """How much is missing at the meeting: x and y (m), heading, and each hitch (rad)."""
    if row < 2:
        return float(join.ends[2, row] - join.ends[0, row])
    if row == 2:
        return wrapped(join.ends[2, 2] - join.ends[0, 2])
    return float(join.ends[2, row + 2] - join.ends[0, row + 2])


@inlined
def _worst(join: Join) -> float:
    worst = 0.0
    for row in range(join.ends.shape[1] - 2):
        worst = max(worst, abs(_off(join, row)))
    return worst


@inlined
def _solve(squares: Floats, rows: int) -> None:
    """Solve the equations by elimination; they are positive definite. The solution is the last column."""
    for i in range(rows):
        for j in range(rows):
            if j != i:
                factor = squares[j, i] / squares[i, i]
                for k in range(i, rows + 1):
                    squares[j, k] -= factor * squares[i, k]
    for i in range(rows):
        squares[i, rows] /= squares[i, i]


@lean
def close(start: Floats, join: Join, vehicle: Vehicle) -> bool:
    """Correct the arcs until they lead from ``start [1, S]`` to ``join.ends[1]``. Returns whether they do.

    Arcs after the meeting are followed from their end back to it: errors do not grow along them.
    """
    rows = join.ends.shape[1] - 2
    columns = 2 * join.counts[ARCS]
    for column in range(columns):
        join.free[column] = 1.0
    limit = tightest_bend(turning_speed(vehicle), vehicle)
    size = vehicle.front + vehicle.rear
    follow(start, join, vehicle)
    for _ in range(ROUNDS):
        worst = _worst(join)
        if worst < EXACT:
            return True
        if not worst < WIDEST:
            return False
        for row in range(rows):
            join.squares[row, rows] = _off(join, row)
        find_effects(start, join, vehicle)
        for column in range(columns):
            weight = BEND_SHARE * limit if column % 2 == 0 else LENGTH_SHARE * size
            for row in range(rows):
                join.effects[row, column] *= join.free[column] * weight
        for i in range(rows):
            for j in range(rows):
                total = DAMPING if i == j else 0.0
                for column in range(columns):
                    total += join.effects[i, column] * join.effects[j, column]
                join.squares[i, j] = total
        _solve(join.squares, rows)
        largest = LARGEST
        for column in range(columns):
            change = 0.0
            for row in range(rows):
                change += join.effects[row, column] * join.squares[row, rows]
            join.effects[0, column] = change  # which the next columns do not need
            largest = max(largest, abs(change))
        for column in range(columns):
            change = join.effects[0, column] * LARGEST / largest
            arc = column // 2
            if column % 2 == 0:
                bend = join.arcs[1, arc] + BEND_SHARE * limit * change
                join.arcs[1, arc] = min(max(bend, -limit), limit)
                fits = bend == join.arcs[1, arc]
            else:
                metres = join.arcs[2, arc] + LENGTH_SHARE * size * change
                join.arcs[2, arc] = max(metres, 0.0)
                fits = metres >= 0.0
            join.free[column] = 1.0 if fits else 0.0
        follow(start, join, vehicle)
    return False


@lean
def take_word(join: Join, word: Floats, radius: float, vehicle: Vehicle) -> None:
    """Make the arcs of a word; the longest are divided until there are enough to correct all of a state."""
    bend = bend_with(1.0 / radius, vehicle)
    arcs = join.arcs
    count = 0
    for k in range(PARTS):
        metres = radius * word[PARTS + k]
        if metres != 0.0:
            arcs[0, count] = gear_of(metres)
            arcs[1, count] = bend * word[k]
            arcs[2, count] = abs(metres)
            count += 1
    while 0 < count < join.ends.shape[1] - 2:
        longest = 0
        for k in range(count):
            if arcs[2, k] > arcs[2, longest]:
                longest = k
        for k in range(count, longest, -1):
            for row in range(3):
                arcs[row, k] = arcs[row, k - 1]
        after = min(0.5 * arcs[2, longest], vehicle.front + vehicle.rear)
        arcs[2, longest] -= after
        arcs[2, longest + 1] = after
        count += 1
    join.counts[ARCS] = join.counts[BEFORE] = count


@lean
def trailers_are_off(start: Floats, join: Join, most: float, vehicle: Vehicle) -> bool:
    """Whether the arcs leave a trailer more than ``most`` radians from where it should be."""
    follow(start, join, vehicle)
    for row in range(3, join.ends.shape[1] - 2):  # noqa: SIM110 Numba has no generators for any()
        if not abs(_off(join, row)) <= most:
            return True
    return False


@lean
def arcs_are_free(start: Floats, join: Join, vehicle: Vehicle, scene: Scene) -> tuple[bool, int]:
    """Whether the arcs are free, and how often obstacles were looked at."""
    state = load(start, 0, vehicle)
    looks = 0
    for k in range(join.counts[ARCS]):
        gear = join.arcs[0, k]
        count = math.ceil(join.arcs[2, k] / stride_of(gear, vehicle))
        stride = stride_in(state, gear, join.arcs[1, k], join.arcs[2, k] / max(count, 1), vehicle)
        for _ in range(count):
            state, free, checks = stride_along(state, stride, vehicle, scene)
            looks += checks
            if free < stride.metres:
                return False, looks
    return True, looks
