"""Hybrid A* (Dolgov et al., IJRR 2010), the planner of manoeuvres that the field begins with, for cars.

It searches from the start over short arcs in both gears, one state for each cell, heading and gear, by cost
so far and the larger of two estimates: turns without obstacles, and the way over free cells. From each state,
or every few, it tries the shortest Reeds-Shepp curve to the goal. What it finds is driven from rest to rest
by the same code as the arcs of our search, and polished by our optimiser, in place of the smoothing that
others do by descent or optimal control. Collision checks, curves, cells and queue are ours, so that only the
search is compared. ``python -m tests.speed.peers.hybrid_astar`` tunes its settings.
"""

from __future__ import annotations

import argparse
import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.pose_table import seconds_from, seconds_to_pose
from planners.search.manoeuvres.arcs import stride_along, stride_in, stride_of
from planners.search.structures.cost_to_go import (
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
)
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats, Integers, Pose
from planners.world.classes.families import family
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene, scene_of
from planners.world.geometry.occupancy import drawing_of, window_of
from planners.world.goal import HEADING, X, Y, goal_of
from planners.world.jit import inlined, jit
from planners.world.problem import Plan, Problem, start_state
from planners.world.trigonometry import wrapped
from planners.world.vehicles.dynamics import State, load, store, tightest_bend, top_speed, turning_speed
from planners.world.vehicles.vehicle import CAR, Car, Vehicle, state_size
from planners.world.workspace import Workspace
from tests.speed.peers.curves import ARCS, Curves, add_curve, allocate_curves, drive_arcs, driven

NODES: Final = 1 << 20  # each expansion stores ten at most
SLOTS: Final = 1 << 20  # of the table of cells, more than there can be cells
EXPANSIONS: Final = 60_000  # as our search has for a pose
GOAL_CELL_M: Final = 0.1  # around the goal that counts as there


class Settings(NamedTuple):
    """What is tuned (``python -m tests.speed.peers.hybrid_astar``); lengths are in those of the vehicle."""

    cell: float = 0.1
    headings: int = 96
    arc: float = 0.1  # length of an arc
    bends: int = 3  # on each side of 0: so many steering angles
    gear_change_s: float = 1.0
    bend_change_s: float = 0.1  # for a change by the tightest bend
    weight: float = 1.5  # of the estimate
    curve_every: float = 0.0  # states for each second of the estimate: between two curves to the goal


SETTINGS: Final = Settings()


class Search(NamedTuple):
    """Buffers."""

    keys: Integers  # [SLOTS] of the cells that were reached
    least: Floats  # [SLOTS] the seconds of the quickest way to each
    numbers: Integers  # [SLOTS] the number of the search that reached it
    counts: Integers  # [1] the number of this search
    frontier: Frontier
    states: Floats  # [NODES, 5]
    seconds: Floats  # [NODES]
    parents: Integers  # [NODES]
    gears: Floats  # [NODES] of the arc that leads there
    bends: Floats  # [NODES]
    metres: Floats  # [NODES] its length
    curves: Curves
    go: CostToGo
    table: Floats  # that of ``seconds_to_pose``


def allocate_search(vehicle: Vehicle) -> Search:
    """Buffers for a vehicle, with its table of turns."""
    floats = np.zeros((4, NODES))
    return Search(
        np.zeros(SLOTS, np.int64),
        np.zeros(SLOTS),
        np.zeros(SLOTS, np.int32),
        np.zeros(1, np.int32),
        allocate_frontier(),
        np.zeros((NODES, state_size(vehicle))),
        floats[0],
        np.zeros(NODES, np.int32),
        floats[1],
        floats[2],
        floats[3],
        allocate_curves(state_size(vehicle)),
        allocate_cost_to_go(),
        seconds_to_pose(vehicle),
    )


@inlined
def _key(state: State, gear: float, cell: float, headings: int) -> int:
    column = math.floor(state[0] / cell) & 0xFFFF
    row = math.floor(state[1] / cell) & 0xFFFF
    turn = int((wrapped(state[2]) + math.pi) * headings / (2.0 * math.pi)) % headings
    return ((((column << 16) | row) * headings + turn) << 1) | (1 if gear > 0.0 else 0)


@inlined
def _slot(key: int, search: Search) -> int:
    """Where a cell is in the table, or where it would be."""
    slot = (key * 2654435761) % SLOTS
    while search.numbers[slot] == search.counts[0] and search.keys[slot] != key:
        slot = (slot + 1) % SLOTS
    return slot


@inlined
def _is_quicker(key: int, seconds: float, search: Search) -> bool:
    """Whether a cell was not reached so quickly before; noted."""
    slot = _slot(key, search)
    if search.numbers[slot] == search.counts[0] and search.least[slot] <= seconds:
        return False
    search.numbers[slot] = search.counts[0]
    search.keys[slot] = key
    search.least[slot] = seconds
    return True


@inlined
def _estimate(state: State, goal: Pose, search: Search, vehicle: Vehicle) -> float:
    turns = seconds_from(state[0], state[1], state[2], goal, search.table, vehicle.max_speed)
    return max(turns, metres_to_go(state[0], state[1], search.go) / vehicle.max_speed)


@inlined
def _list_arcs(search: Search, node: int) -> int:
    """List the arcs to a node; those that go on are joined. Returns how many they are, -1 without room."""
    arcs = search.curves.arcs
    count = 0
    while node > 0:
        if count == ARCS:
            return -1
        arcs[0, count] = search.gears[node]
        arcs[1, count] = search.bends[node]
        arcs[2, count] = search.metres[node]
        node = search.parents[node]
        count += 1
    for k in range(count // 2):
        for row in range(3):
            other = count - 1 - k
            arcs[row, k], arcs[row, other] = arcs[row, other], arcs[row, k]
    joined = 0
    for k in range(count):
        last = joined - 1
        if joined > 0 and arcs[0, last] == arcs[0, k] and arcs[1, last] == arcs[1, k]:
            arcs[2, last] += arcs[2, k]
        else:
            for row in range(3):
                arcs[row, joined] = arcs[row, k]
            joined += 1
    return joined


@jit
def _find(
    search: Search,
    start: Floats,
    goal: Floats,
    most: int,
    settings: Settings,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[bool, int]:
    """Search from ``start [1, S]``.

    Returns whether ``search.curves.drive`` leads to the goal, and how many expansions there were.
    """
    size = vehicle.front + vehicle.rear
    cell = settings.cell * size
    limit = tightest_bend(turning_speed(vehicle), vehicle)
    there = (goal[X], goal[Y], goal[HEADING])
    frontier = search.frontier
    clear_frontier(frontier)
    nodes = 1
    state = load(start, 0, vehicle)
    store(search.states, 0, state)
    search.seconds[0] = search.gears[0] = search.bends[0] = 0.0
    search.parents[0] = -1
    search.counts[0] += 1
    _is_quicker(_key(state, 0.0, cell, settings.headings), 0.0, search)
    push(frontier, 0.0, 0, 0)
    expansions = 0
    wait = 0
    while expansions < most and not is_empty(frontier):
        node, _ = pop(frontier)
        state = load(search.states, node, vehicle)
        key = _key(state, search.gears[node], cell, settings.headings)
        if search.seconds[node] > search.least[_slot(key, search)]:
            continue  # there was a quicker way meanwhile
        expansions += 1
        wait -= 1
        if wait <= 0:
            count = _list_arcs(search, node)
            if count >= 0:
                count, _ = add_curve(search.curves, state, count, there, vehicle, scene)
                if count >= 0 and drive_arcs(search.curves, start, count, goal, vehicle, scene):
                    return True, expansions
            wait = int(settings.curve_every * _estimate(state, there, search, vehicle))
        for gear in (1.0, -1.0):
            stride_m = stride_of(gear, vehicle)
            strides = max(round(settings.arc * size / stride_m), 1)
            top = top_speed(gear, 0.0, vehicle)
            for turn in range(-settings.bends, settings.bends + 1):
                bend = limit * turn / settings.bends
                stride = stride_in(state, gear, bend, stride_m, vehicle)
                after = state
                free = stride_m
                for _ in range(strides):
                    after, free, _ = stride_along(after, stride, vehicle, scene)
                    if free < stride_m:
                        break
                if free < stride_m or nodes == NODES:
                    continue
                seconds = search.seconds[node] + strides * stride_m / top
                if gear * search.gears[node] < 0.0:
                    seconds += settings.gear_change_s
                seconds += settings.bend_change_s * abs(bend - search.bends[node]) / limit
                if not _is_quicker(_key(after, gear, cell, settings.headings), seconds, search):
                    continue
                store(search.states, nodes, after)
                search.metres[nodes] = strides * stride_m
                search.seconds[nodes] = seconds
                search.parents[nodes] = node
                search.gears[nodes] = gear
                search.bends[nodes] = bend
                estimate = seconds + settings.weight * _estimate(after, there, search, vehicle)
                push(frontier, estimate, nodes, 0)
                nodes += 1
    return False, expansions


class Found(NamedTuple):
    """One attempt."""

    plan: Plan | None
    seconds: float  # of the processor's clock, compiling left out
    expansions: int


def hybrid_astar(
    problem: Problem,
    vehicle: Car,
    workspace: Workspace,
    settings: Settings = SETTINGS,
    expansions: int = EXPANSIONS,
) -> Found:
    """Plan for a pose at rest, in the canonical frame."""
    search: Search = workspace.buffers(allocate_search, vehicle)  # type: ignore[arg-type]
    began = working_clock()
    scene = scene_of(problem)
    occupied = drawing_of(problem, workspace).occupied
    fill_cost_to_go(occupied, *problem.goal, GOAL_CELL_M, window_of(problem), search.go)
    start, goal = start_state(problem, vehicle)[np.newaxis], goal_of(problem, vehicle)
    found, used = _find(search, start, goal, expansions, settings, vehicle, scene)
    plan = driven(search.curves, problem, vehicle, scene, workspace) if found else None
    return Found(plan, working_clock() - began, used)


TRIED: Final[dict[str, tuple[float, ...]]] = {
    "cell": (0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3),
    "headings": (36, 72, 96, 144),
    "arc": (0.06, 0.1, 0.15, 0.2, 0.3),
    "bends": (1, 2, 3),
    "gear_change_s": (0.0, 0.25, 0.5, 1.0, 2.0),
    "bend_change_s": (0.0, 0.05, 0.1, 0.3, 0.6),
    "weight": (1.0, 1.25, 1.5, 2.0, 3.0),
    "curve_every": (0.0, 1.0, 2.0, 4.0, 8.0),
}
FAMILIES: Final = ("parallel", "perpendicular", "angled", "lot")
DIFFICULTIES: Final = ("standard", "hard")
UNSOLVED_S: Final = 30.0  # what a problem counts that was not solved
TUNING_SEED: Final = 91


def _cost(problems: list[Problem], settings: Settings, workspace: Workspace) -> tuple[float, int, float]:
    """Mean seconds of planning and driving, how many were solved, and the mean of planning."""
    found = [hybrid_astar(problem, CAR, workspace, settings=settings) for problem in problems]
    total = [each.seconds + (UNSOLVED_S if each.plan is None else each.plan.duration_s) for each in found]
    solved = sum(each.plan is not None for each in found)
    return float(np.mean(total)), solved, float(np.mean([each.seconds for each in found]))


def main() -> None:
    """Tune: one setting after another, twice round."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--questions", type=int, default=12, help="of each family and difficulty")
    asked = parser.parse_args()
    problems = [
        to_canonical(family(name, difficulty, CAR).draw(TUNING_SEED, index))[0]
        for name in FAMILIES
        for difficulty in DIFFICULTIES
        for index in range(asked.questions)
    ]
    workspace, best = Workspace(), SETTINGS
    _cost(problems[:3], best, workspace)
    least, *rest = _cost(problems, best, workspace)
    print(f"{best}: {least:.3f} s, {rest[0]} of {len(problems)}, {1e3 * rest[1]:.0f} ms", flush=True)
    for _ in range(2):
        for name, values in TRIED.items():
            for value in values:
                tried = best._replace(**{name: value})
                if tried == best:
                    continue
                cost, *rest = _cost(problems, tried, workspace)
                print(f"{name} {value}: {cost:.3f} s, {rest[0]} solved, {1e3 * rest[1]:.0f} ms", flush=True)
                if cost < least:
                    least, best = cost, tried
        print(best, f"{least:.3f} s", flush=True)


if __name__ == "__main__":
    main()
