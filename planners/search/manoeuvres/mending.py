"""Makes drives of ways over places where two trees all but meet: optimisation closes the gaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from planners.optimisation.interior.retiming import retimed
from planners.optimisation.polish import NEAR_ITERATIONS, polish_guesses
from planners.search.manoeuvres.driving import Drive, cost_of_drive
from planners.search.manoeuvres.near_meetings import SIZE, lay_way
from planners.search.manoeuvres.pose_tree import PoseTree
from planners.search.manoeuvres.ways import last_is_worth, meeting_is_worth
from planners.search.query import Query
from planners.world.arrays import Floats
from planners.world.vehicles.vehicle import Vehicle

WAYS_AT_A_TIME: Final = 4  # that are optimised together


def mend(
    query: Query, drive: Drive, before: PoseTree, tree: PoseTree, vehicle: Vehicle, until: float
) -> bool:
    """Try the best of ``drive.near`` that were not tried yet; whether ``drive`` leads to the goal now.

    Args:
        query: the problem, and the buffers.
        drive: to be filled in.
        before: the tree out of the start.
        tree: the tree out of the goal.
        vehicle: what is driven.
        until: when to end, by ``working_clock``.
    """
    near = drive.near
    left = np.flatnonzero(near.tried[: near.counts[SIZE]] == 0)
    pairs: list[tuple[PoseTree, int, PoseTree, int]] = []
    ways: list[Floats] = []
    for k in left[np.argsort(near.off[left], kind="stable")]:
        if len(ways) == WAYS_AT_A_TIME:
            break
        near.tried[k] = 1
        pair = before, int(near.lasts[k]), tree, int(near.nodes[k])
        rows = lay_way(drive.states, drive.join.chain, *pair, vehicle)
        if rows > 1 and meeting_is_worth(drive.ways, *pair, vehicle):
            pairs.append(pair)
            ways.append(drive.states[:rows].copy())
    number = drive_one_of(ways, query, drive, vehicle, until)
    if number < 0:
        return False
    meeting_is_worth(drive.ways, *pairs[number], vehicle)  # the last that was looked at is what is kept
    drive.ways.last_cost[0] = cost_of_drive(drive, vehicle)
    return last_is_worth(drive.ways)


def drive_one_of(
    ways: Sequence[Floats],
    query: Query,
    drive: Drive,
    vehicle: Vehicle,
    until: float,
    near: int = NEAR_ITERATIONS,
) -> int:
    """Make a drive of the one of several ways that gets quickest by optimisation.

    Args:
        ways: each ``[T, S]``, from the start to the goal; speeds only say in which gear it is driven.
        query: the problem, and the buffers.
        drive: to be filled in.
        vehicle: what is driven.
        until: when to end, by ``working_clock``.
        near: that of ``polish_guesses``.

    Returns:
        The number of the way; -1 if none becomes a drive.
    """
    if not ways:
        return -1
    guesses = [retimed(way, vehicle) for way in ways]
    around = vehicle, query.scene, query.workspace
    number, found = polish_guesses(query.problem, guesses, *around, until, query.limits.bound_s, near)
    plan = found.plan
    if plan is None or len(plan.controls) > len(drive.controls):
        return -1
    steps = len(plan.controls)
    drive.states[: steps + 1], drive.controls[:steps] = plan.states, plan.controls
    drive.counts[:] = steps, 0, 0
    return number
