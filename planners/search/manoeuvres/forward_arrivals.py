"""Lets a train that backs into its goal arrive forwards, in a loop.

A search finds how to arrive by driving out of the goal pose, and on the way out of a drive forwards trailers
fold. So it often drives a train past its goal and backs it in, where it could have swung out before. From
states of such a drive loops are laid into the goal, as where a train turns round, and optimisation makes
drives of those that promise most.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from planners.optimisation.interior.retiming import retimed
from planners.search.manoeuvres.driving import Drive, allocate_drive
from planners.search.manoeuvres.loops import allocate_loops, lay_loop, list_loops
from planners.search.manoeuvres.mending import drive_one_of
from planners.search.manoeuvres.pose_tree import pose_of
from planners.search.manoeuvres.suitability import suits
from planners.search.manoeuvres.variants import word_radius
from planners.search.query import Query
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of, gears_of
from planners.world.geometry.collision import count_free_prefix
from planners.world.goal import goal_of
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import (
    FIRST_HITCH,
    Vehicle,
    length_of_trailers,
    state_size,
    trailers_of,
)

AT_LAST: Final = 0.25  # lengths of all trailers at the end of a drive: if they lead backwards, it backs in
APART: Final = 1.0  # lengths of all trailers between states from which loops are laid
MOST_STATES: Final = 16  # of them, the last ones of the drive ...
NEAR: Final = 3.0  # ... that are no farther from the goal, in lengths of the whole train
RUN_IN: Final = 0.5  # lengths of all trailers: where so much straight ahead of the goal is blocked, none fits
BLOCKED: Final = 3.0  # times its cost: so much more a loop is expected to cost if all of it is blocked
LOOKED_AT: Final = 6  # loops that may cost least: what they cost is estimated more closely
TRIES: Final = 3  # loops that are optimised
ITERATIONS: Final = 60  # with so many iterations each
GAIN: Final = 0.05  # share of its cost that a drive must be expected to save


def arrive_forwards(query: Query, plan: Plan, until: float, below_s: float = math.inf) -> Plan | None:
    """End a drive in a loop, if that costs less; None if it does not end backwards, or no loop does.

    A train that is quicker backwards mostly has quicker ways.

    Args:
        query: the problem, and the buffers.
        plan: for the problem, polished.
        until: when to end, by ``working_clock``.
        below_s: only a drive that costs less is wanted.
    """
    vehicle, goal = query.vehicle, goal_of(query.problem, query.vehicle)
    reverses = 0.0 < -vehicle.min_speed <= vehicle.max_speed
    if not trailers_of(vehicle) or not reverses or not suits(goal, vehicle) or not _backs_in(plan, vehicle):
        return None
    end = pose_of(goal, state_size(vehicle))
    before = end.copy()
    before[FIRST_HITCH:] = 0.0
    before[:2] -= RUN_IN * length_of_trailers(vehicle) * np.array([math.cos(end[2]), math.sin(end[2])])
    if count_free_prefix(before[np.newaxis], vehicle, query.scene) == 0:
        return None
    cost = min(cost_of(plan, vehicle), below_s)
    drive = query.workspace.buffers(allocate_drive, state_size(vehicle))
    ways = _promising(query, plan, end, drive, (1.0 - GAIN) * cost, until)
    bounded = replace(query, limits=replace(query.limits, bound_s=cost))
    if drive_one_of(ways, bounded, drive, vehicle, until, ITERATIONS) < 0:
        return None
    steps = int(drive.counts[0])
    better = Plan(drive.states[: steps + 1].copy(), drive.controls[:steps].copy(), vehicle.dt)
    return better if cost_of(better, vehicle) < cost else None


def _backs_in(plan: Plan, vehicle: Vehicle) -> bool:
    """Whether a drive ends backwards, but maybe for a last correction."""
    metres = np.hypot(*np.diff(plan.states[:, :2], axis=0).T)
    at_last = metres[::-1].cumsum()[::-1] <= AT_LAST * length_of_trailers(vehicle)
    return bool((gears_of(plan, vehicle) * metres)[at_last].sum() < 0.0)


def _promising(
    query: Query, plan: Plan, end: Floats, drive: Drive, below: float, until: float
) -> list[Floats]:
    """Ways ``[T, S]`` into ``end [S]`` of different kinds, each expected to cost less than ``below``."""
    vehicle = query.vehicle
    loops = query.workspace.buffers(allocate_loops)
    around = word_radius(vehicle), length_of_trailers(vehicle), vehicle
    found: list[tuple[float, float, Floats, tuple[float, ...]]] = []
    for begins in _beginnings(plan, end, vehicle):
        if working_clock() >= until:
            break
        start = plan.states[begins : begins + 1].copy()
        start[0, 3] = 0.0  # the gear may change
        list_loops(loops, start, end[np.newaxis], *around, query.scene)
        for k in np.flatnonzero(loops.blocked < 1.0).tolist():
            metres, longer = loops.metres[k], 1.0 + BLOCKED * loops.blocked[k]
            seconds = np.where(metres > 0.0, metres / vehicle.max_speed, metres / vehicle.min_speed).sum()
            least = longer * (begins * vehicle.dt + seconds)
            rows = lay_loop(drive.states, loops, k, start, vehicle) if least < below else 0
            if rows > 1:
                way = np.concatenate([plan.states[:begins], drive.states[:rows]])
                way[0] = plan.states[0]  # it may be in motion, where the loop begins at the start, too
                found.append((least, longer, way, tuple(np.sign(loops.bends[k]).tolist())))
    found.sort(key=lambda each: each[0])
    of_kinds: dict[tuple[float, ...], Floats] = {}
    for _, longer, way, kind in found[:LOOKED_AT]:
        if kind not in of_kinds and longer * cost_of(retimed(way, vehicle), vehicle) < below:
            of_kinds[kind] = way
    return list(of_kinds.values())[:TRIES]


def _beginnings(plan: Plan, end: Floats, vehicle: Vehicle) -> list[int]:
    """Numbers of states of a drive, some way apart, from which loops may lead to its end."""
    train = length_of_trailers(vehicle)
    along = np.cumsum(np.hypot(*np.diff(plan.states[:, :2], axis=0).T))
    _, firsts = np.unique(np.floor(along / (APART * train)), return_index=True)
    off = np.hypot(*(plan.states[firsts, :2] - end[:2]).T)
    near: list[int] = firsts[off <= NEAR * (vehicle.front + vehicle.rear + train)].tolist()
    return near[-MOST_STATES:]
