"""Lets a train that backs into its goal arrive forwards, in a loop.

A search finds how to arrive by driving out of the goal pose, and on the way out of a drive forwards trailers
fold. So it often drives a train past its goal and backs it in, where it could have swung out before. From
states of such a drive loops are laid into the goal, as where a train turns round, and optimisation makes
drives of those that promise most.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

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
from planners.world.vehicles.vehicle import Vehicle, state_size, trailers_of

AT_LAST: Final = 0.25  # lengths of all trailers at the end of a drive: if they lead backwards, it backs in
APART: Final = 0.5  # lengths of all trailers between states from which loops are laid
MOST_STATES: Final = 16  # of them, the last ones of the drive ...
NEAR: Final = 3.0  # ... that are no farther from the goal, in lengths of the whole train
RUN_IN: Final = 0.5  # lengths of all trailers: where so much straight ahead of the goal is blocked, none fits
BLOCKED: Final = 3.0  # times its cost: so much more a loop is expected to cost if all of it is blocked
TRIES: Final = 3  # loops that are optimised
ITERATIONS: Final = 60  # with so many iterations each
GAIN: Final = 0.05  # share of its cost that a drive must be expected to save


class _Way(NamedTuple):
    """A drive up to one of its states, and a loop from there."""

    states: Floats  # [T, S]
    expected: float  # what it will cost
    bends: tuple[float, ...]  # signs of those of the loop's arcs


def arrive_forwards(query: Query, plan: Plan, until: float) -> Plan | None:
    """End a drive in a loop, if that costs less; None if it does not end backwards, or no loop does.

    A train that is quicker backwards mostly has quicker ways.

    Args:
        query: the problem, and the buffers.
        plan: for the problem, polished.
        until: when to end, by ``working_clock``.
    """
    vehicle, goal = query.vehicle, goal_of(query.problem, query.vehicle)
    reverses = 0.0 < -vehicle.min_speed <= vehicle.max_speed
    if not trailers_of(vehicle) or not reverses or not suits(goal, vehicle) or not _backs_in(plan, vehicle):
        return None
    end = pose_of(goal, state_size(vehicle))
    before = end.copy()
    before[:2] -= RUN_IN * _train(vehicle) * np.array([math.cos(end[2]), math.sin(end[2])])
    if count_free_prefix(before[np.newaxis], vehicle, query.scene) == 0:
        return None
    cost = cost_of(plan, vehicle)
    drive = query.workspace.buffers(allocate_drive, state_size(vehicle))
    ways = _promising(query, plan, end, drive, (1.0 - GAIN) * cost, until)
    bounded = replace(query, limits=replace(query.limits, bound_s=cost))
    if drive_one_of([way.states for way in ways], bounded, drive, vehicle, until, ITERATIONS) < 0:
        return None
    steps = int(drive.counts[0])
    better = Plan(drive.states[: steps + 1].copy(), drive.controls[:steps].copy(), vehicle.dt)
    return better if cost_of(better, vehicle) < cost else None


def _train(vehicle: Vehicle) -> float:
    """The length of all trailers, in metres."""
    return sum(each.hitch_length for each in trailers_of(vehicle))


def _backs_in(plan: Plan, vehicle: Vehicle) -> bool:
    """Whether a drive ends backwards, but maybe for a last correction."""
    metres = np.hypot(*np.diff(plan.states[:, :2], axis=0).T)
    at_last = metres[::-1].cumsum()[::-1] <= AT_LAST * _train(vehicle)
    return bool((gears_of(plan, vehicle) * metres)[at_last].sum() < 0.0)


def _promising(query: Query, plan: Plan, end: Floats, drive: Drive, below: float, until: float) -> list[_Way]:
    """The ways into ``end [S]`` that are expected to cost least, each less than ``below``, one of a kind."""
    vehicle, found = query.vehicle, []
    loops = query.workspace.buffers(allocate_loops)
    around = word_radius(vehicle), _train(vehicle), vehicle
    for begins in _beginnings(plan, end, vehicle):
        if working_clock() >= until:
            break
        start = plan.states[begins : begins + 1]
        list_loops(loops, start, end[np.newaxis], *around, query.scene)
        for k in np.flatnonzero(loops.blocked < 1.0).tolist():
            rows = lay_loop(drive.states, loops, k, start, vehicle)
            if rows > 1:
                states = np.concatenate([plan.states[:begins], drive.states[:rows]])
                expected = (1.0 + BLOCKED * loops.blocked[k]) * cost_of(retimed(states, vehicle), vehicle)
                found.append(_Way(states, expected, tuple(np.sign(loops.bends[k]).tolist())))
    of_kinds: dict[tuple[float, ...], _Way] = {}
    for way in sorted(found, key=lambda way: way.expected):
        if way.expected < below:
            of_kinds.setdefault(way.bends, way)
    return list(of_kinds.values())[:TRIES]


def _beginnings(plan: Plan, end: Floats, vehicle: Vehicle) -> list[int]:
    """Numbers of states of a drive, some way apart, from which loops may lead to its end."""
    train = _train(vehicle)
    along = np.cumsum(np.hypot(*np.diff(plan.states[:, :2], axis=0).T))
    _, firsts = np.unique(np.floor(along / (APART * train)), return_index=True)
    off = np.hypot(*(plan.states[firsts, :2] - end[:2]).T)
    near: list[int] = firsts[off <= NEAR * (vehicle.front + vehicle.rear + train)].tolist()
    return near[-MOST_STATES:]
