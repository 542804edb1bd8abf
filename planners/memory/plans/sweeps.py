"""The swept boxes of stored plans.

A plan's inflated footprints do not depend on the problem, so they are made once. They are exactly the boxes
that ``collision.state_is_free`` tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.memory.plans.plan_arrays import StoredPlans, store_plans
from planners.world.arrays import Floats, Indices, Integers
from planners.world.jit import jit
from planners.world.problem import Plan
from planners.world.vehicles.bodies import body_count
from planners.world.vehicles.dynamics import load, swept_bodies
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size

COARSEST_STRIDE = 64  # steps between the states that are checked first: some 20 m of driving


class PlanSweeps(NamedTuple):
    """The swept boxes of N plans, packed for the kernels."""

    boxes: Floats  # [S, 6] centre x, y (m), cos, sin of the heading, half length, half width with margin (m)
    starts: Integers  # [N + 1] plan i owns boxes[starts[i] : starts[i + 1]], coarse steps first
    first_poses: Floats  # [N, 3] x, y in metres, heading in radians
    last_positions: Floats  # [N, 2] metres


@jit
def coarse_to_fine(count: int) -> Integers:
    """Order ``0 .. count - 1``: every 64th first, then those half-way between, and so on.

    Neighbouring states collide together, so states far apart find a collision sooner.
    """
    order = np.empty(count, np.int32)
    placed = 0
    stride = COARSEST_STRIDE
    for i in range(0, count, stride):
        order[placed] = i
        placed += 1
    while stride > 1:
        for i in range(stride // 2, count, stride):
            order[placed] = i
            placed += 1
        stride //= 2
    return order


@jit
def _fill_sweeps(states: Floats, starts: Indices, vehicle: Vehicle, boxes: Floats) -> None:
    filled = 0
    for i in range(starts.shape[0] - 1):
        for t in coarse_to_fine(starts[i + 1] - starts[i]):
            for box in swept_bodies(load(states, starts[i] + t, vehicle), vehicle):
                for k in range(6):
                    boxes[filled, k] = box[k]
                filled += 1


def sweep_plans(plans: Sequence[Plan], vehicle: Vehicle = CAR) -> PlanSweeps:
    """Make the swept boxes of plans."""
    stored = store_plans(plans, state_size(vehicle))
    boxes = np.empty((body_count(vehicle) * len(stored.states), 6))
    _fill_sweeps(stored.states, stored.starts, vehicle, boxes)
    return sweeps_with(boxes, stored)


def sweeps_with(boxes: Floats, plans: StoredPlans) -> PlanSweeps:
    """Make the sweeps of plans from boxes ``[S, 6]`` that were made before.

    Raises ValueError if there are too few or too many boxes.
    """
    bodies, rest = divmod(len(boxes), max(1, len(plans.states)))
    if rest or (len(boxes) > 0) != (bodies > 0):
        raise ValueError(f"{len(boxes)} swept boxes do not belong to {len(plans.states)} states")
    first, last = plans.states[plans.starts[:-1]], plans.states[plans.starts[1:] - 1]
    starts = (bodies * plans.starts).astype(np.int32)
    return PlanSweeps(boxes, starts, first[:, :3].copy(), last[:, :2].copy())
