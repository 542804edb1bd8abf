"""Of some stored plans the one that is nearly free: what repair mends, and an open box goes on from."""

from __future__ import annotations

import math

from planners.memory.plans.sweeps import START_TOLERANCE, PlanSweeps, turned_box_is_free
from planners.world.arrays import Integers
from planners.world.geometry.collision import Scene
from planners.world.jit import lean

SHARE = 4  # one box in so many is tried: sweeps have coarse steps first, so these lie evenly along the plan


@lean
def least_blocked(
    order: Integers, sweeps: PlanSweeps, scene: Scene, start: tuple[float, float, float]
) -> tuple[int, int]:
    """The plan of ``order`` with the fewest blocked boxes (-1: none begins there), and the checks made.

    Plans are turned rigidly about their first position to the start's heading; of equal ones the first.
    """
    best = -1
    fewest = 0
    checks = 0
    for i in order:
        px = sweeps.first_poses[i, 0]
        py = sweeps.first_poses[i, 1]
        if abs(px - start[0]) > START_TOLERANCE or abs(py - start[1]) > START_TOLERANCE:
            continue
        cos = math.cos(start[2] - sweeps.first_poses[i, 2])
        sin = math.sin(start[2] - sweeps.first_poses[i, 2])
        first = sweeps.starts[i]
        blocked = 0
        for j in range(first, first + (sweeps.starts[i + 1] - first + SHARE - 1) // SHARE):
            if best >= 0 and blocked >= fewest:
                break
            checks += 1
            blocked += not turned_box_is_free(sweeps.boxes, j, px, py, cos, sin, scene)
        if best < 0 or blocked < fewest:
            best = i
            fewest = blocked
    return best, checks
