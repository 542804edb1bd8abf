"""Recalls sub-plans one after another, where no single one leads to the goal: the best way first.

Ways grow from the start like a tree. Its nodes are the ends of sub-plans, and the one from which the goal
is nearest by time is the next to go on. An end that is like a better one found before is left out. Where no
sub-plan leads to a new end, short generic drives go on.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.memory.library.driving import ARRIVED, BLOCKED, drive_again
from planners.memory.library.onward import GREED, LISTED, Ground, list_stretches, seconds_left
from planners.memory.library.recalling import (
    CHECKED,
    LONGER,
    LOOKS,
    STEPS,
    Recalling,
    glances_are_free,
    keep_tried,
    recall_one,
)
from planners.memory.library.stretches import MOST_STEPS, Stretches
from planners.memory.library.sub_plans import SubPlans
from planners.search.primitives import SHARES, Lattice, controls_of
from planners.search.structures.cost_to_go import metres_to_go
from planners.world.arrays import Floats, Integers
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import RADIUS, X, Y
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length, wrapped
from planners.world.vehicles.dynamics import State, load, step, store
from planners.world.vehicles.vehicle import Vehicle

NODES: Final = 128
ROOM: Final = MOST_STEPS + LONGER  # steps to a node from the one before
BRANCHES: Final = 3  # stretches that lead on from a node, at most
CUT: Final = 5  # steps at the end of a sub-plan, behind which a wall may stand
ALL: Final = 8_000  # looks for all together, drives and lists not counted
EACH: Final = 25  # looks from a node for a sub-plan to the goal
NEAR: Final = 1.3, 4.0  # it is looked for if the way is at most so many times straight ahead, and so many m
SAME_END: Final = 0.7, 0.3, 0.7  # ends no farther apart than so many m, radians and m/s lead to the same
GENERIC: Final = Lattice(steps=8, speeds=3)  # drives where no sub-plan leads to a new end ...
GENERICS: Final = 3  # ... of which so many are kept, the best
PARENT, DRIVEN, ROW, STORED, IS_OPEN = range(5)  # columns of Chains.nodes


class Chains(NamedTuple):
    """Buffers for one question at a time: ways as a tree, whose node 0 is the start."""

    states: Floats  # [NODES, ROOM + 1, S] behind each node's parent
    controls: Floats  # [NODES, ROOM, 2]
    estimates: Floats  # [NODES] of the time to the goal
    nodes: Integers  # [NODES, 5] parent, steps from there; steps from the start, of these stored; 1 if open
    listed: Integers  # [LISTED] stretches, the best first; of mirrored ones -1 - number
    listed_estimates: Floats  # [LISTED]


def allocate_chains(state_size: int) -> Chains:
    """Buffers for states of ``state_size`` numbers."""
    return Chains(
        np.zeros((NODES, ROOM + 1, state_size)),
        np.zeros((NODES, ROOM, 2)),
        np.zeros(NODES),
        np.zeros((NODES, 5), np.int32),
        np.zeros(LISTED, np.int32),
        np.zeros(LISTED),
    )


@inlined
def _put_node(
    node: int,
    parent: int,
    driven: int,
    stored: int,
    estimate: float,
    chains: Chains,
    r: Recalling,
    vehicle: Vehicle,
) -> None:
    """Make the drive that was tried from ``parent`` a node."""
    nodes = chains.nodes
    nodes[node, PARENT] = parent
    nodes[node, DRIVEN] = driven
    nodes[node, ROW] = nodes[parent, ROW] + driven
    nodes[node, STORED] = nodes[parent, STORED] + stored
    nodes[node, IS_OPEN] = 1
    chains.estimates[node] = estimate
    for i in range(driven):
        chains.controls[node, i, 0] = r.tried_controls[i, 0]
        chains.controls[node, i, 1] = r.tried_controls[i, 1]
        store(chains.states[node], i + 1, load(r.tried_states, i + 1, vehicle))


@lean
def _drive_generic(
    parent: int, count: int, ground: Ground, chains: Chains, r: Recalling, vehicle: Vehicle, scene: Scene
) -> int:
    """Add the best free generic drives from a node. Returns how many nodes there are then."""
    first = count
    for motion in range(len(SHARES) * GENERIC.speeds):
        state = load(r.tried_states, 0, vehicle)
        free = True
        for i in range(GENERIC.steps):
            control_1, control_2 = controls_of(state, motion, GENERIC, vehicle)
            state = step(state, control_1, control_2, vehicle)
            r.work[CHECKED] += 1
            r.work[LOOKS] += 1
            free = state_is_free(state, vehicle, scene)
            if not free:
                break
            r.tried_controls[i, 0] = control_1
            r.tried_controls[i, 1] = control_2
            store(r.tried_states, i + 1, state)
        if not free:
            continue
        spent = (chains.nodes[parent, ROW] + GENERIC.steps) * vehicle.dt
        estimate = spent + GREED * seconds_left(state, ground, vehicle)
        node = count
        if count == min(first + GENERICS, NODES):
            node = first
            for other in range(first + 1, count):
                if chains.estimates[other] > chains.estimates[node]:
                    node = other
            if chains.estimates[node] <= estimate:
                continue
        _put_node(node, parent, GENERIC.steps, 0, estimate, chains, r, vehicle)
        count = max(count, node + 1)
    return count


@inlined
def _write_way(node: int, chains: Chains, r: Recalling, vehicle: Vehicle) -> None:
    """Write the way to a node into the answer."""
    row = chains.nodes[node, ROW]
    while node > 0:
        driven = chains.nodes[node, DRIVEN]
        row -= driven
        for i in range(driven):
            r.controls[row + i, 0] = chains.controls[node, i, 0]
            r.controls[row + i, 1] = chains.controls[node, i, 1]
            store(r.states, row + i + 1, load(chains.states[node], i + 1, vehicle))
        node = chains.nodes[node, PARENT]


@inlined
def _is_new(end: State, estimate: float, count: int, chains: Chains, vehicle: Vehicle) -> bool:
    """Whether no node so far that has a better estimate ends like this."""
    for node in range(1, count):
        if chains.estimates[node] > estimate:
            continue
        other = load(chains.states[node], chains.nodes[node, DRIVEN], vehicle)
        if (
            length(end[0] - other[0], end[1] - other[1]) < SAME_END[0]
            and abs(wrapped(end[2] - other[2])) < SAME_END[1]
            and abs(end[3] - other[3]) < SAME_END[2]
        ):
            return False
    return True


@inlined
def _next_node(count: int, chains: Chains) -> int:
    """The open node with the least estimate, -1 if none is open."""
    best = -1
    for node in range(count):
        if chains.nodes[node, IS_OPEN] and (best < 0 or chains.estimates[node] < chains.estimates[best]):
            best = node
    return best


@lean
def recall_chain(
    subs: SubPlans,
    stretches: Stretches,
    goal: Floats,
    within: float,
    blindly: int,
    ground: Ground,
    chains: Chains,
    r: Recalling,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[int, int]:
    """Find sub-plans, one after another, from ``r.states[0]`` to a goal, in ``within`` seconds.

    From a node a sub-plan to the goal is sought if the way there is nearly straight, then stretches that lead
    on; if none leads to a new end, generic drives do. Returns all steps, 0 for no answer, and how many are
    stored.
    """
    r.work[LOOKS] = 0
    chains.nodes[0].fill(0)
    chains.nodes[0, IS_OPEN] = 1
    count = 1
    while r.work[LOOKS] < ALL:
        node = _next_node(count, chains)
        if node < 0:
            break
        chains.nodes[node, IS_OPEN] = 0
        _write_way(node, chains, r, vehicle)
        row, stored = chains.nodes[node, ROW], chains.nodes[node, STORED]
        start = load(r.states, row, vehicle)
        metres = metres_to_go(start[0], start[1], ground.ahead.go)
        straight = length(goal[X] - start[0], goal[Y] - start[1]) - ground.ahead.goal[RADIUS]
        if node > 0 and metres < NEAR[0] * straight + NEAR[1]:
            most = within / vehicle.dt - row
            driven = recall_one(subs, row, goal, most, EACH, blindly, ground.cells, r, vehicle, scene)
            if driven > 0:
                return int(row + driven), int(stored + driven)
        if count == NODES:
            continue
        store(r.tried_states, 0, start)
        before = count
        spent = row * vehicle.dt
        listed = list_stretches(
            *(stretches, start, spent, within, ground, chains.listed, chains.listed_estimates, vehicle)
        )
        for c in range(listed):
            if count == NODES or count == before + BRANCHES or r.work[LOOKS] >= ALL:
                break
            k = chains.listed[c]
            side = 1.0 if k >= 0 else -1.0
            k = ((k if k >= 0 else -1 - k) + blindly) % stretches.begins.shape[0]
            begin, steps = stretches.begins[k], stretches.steps[k]
            placing = start[0], start[1], start[2], side
            if row + ROOM > STEPS or not glances_are_free(subs, begin, steps, placing, r, vehicle, scene):
                continue
            driven, ended = drive_again(
                *(subs, begin, begin + steps, placing, goal, steps + LONGER, r.pose),
                *(r.tried_states, r.tried_controls, vehicle, scene),
            )
            r.work[CHECKED] += driven
            if ended == ARRIVED:
                keep_tried(row, driven, r, vehicle)
                return int(row + driven), int(stored + driven)
            if ended == BLOCKED or driven <= CUT:
                continue
            driven -= CUT
            end = load(r.tried_states, driven, vehicle)
            estimate = (row + driven) * vehicle.dt + GREED * seconds_left(end, ground, vehicle)
            if _is_new(end, estimate, count, chains, vehicle):
                _put_node(count, node, driven, driven, estimate, chains, r, vehicle)
                count += 1
        if count == before and row + ROOM <= STEPS:
            count = _drive_generic(node, count, ground, chains, r, vehicle, scene)
    return 0, 0
