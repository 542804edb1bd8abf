"""Which stored plans are free in a problem: exact, and stopped at a plan's first collision.

A plan's inflated footprints do not depend on the problem, so they are made once (``PlanSweeps``); a check
only moves through them. They are exactly the boxes that ``collision.state_is_free`` tests.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.memory.plans.stored_plans import Offsets, StoredPlans, store_plans
from planners.world.arrays import Floats, Integers
from planners.world.geometry.collision import Scene, box_is_free
from planners.world.jit import inlined, jit
from planners.world.problem import Plan
from planners.world.vehicles.bodies import body_count
from planners.world.vehicles.dynamics import load, swept_bodies
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size

Flags = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

COARSEST_STRIDE = 64  # first states visited are 64 steps apart: some 20 m of driving
START_TOLERANCE = 1e-9  # metres and radians: what turning a problem into the canonical frame rounds away


class PlanSweeps(NamedTuple):
    """The swept boxes of N plans, packed for the kernels."""

    boxes: Floats  # [S, 6] centre x, y (m), cos, sin of the heading, half length, half width with margin (m)
    starts: Integers  # [N + 1] plan i owns boxes[starts[i] : starts[i + 1]], coarse steps first
    first_poses: Floats  # [N, 3] x, y in metres, heading in radians
    last_positions: Floats  # [N, 2] metres


@jit
def coarse_to_fine(count: int) -> Integers:
    """A permutation of ``0 .. count - 1``: every 64th first, then those half way between, and so on.

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
def _fill_sweeps(states: Floats, starts: Offsets, vehicle: Vehicle, boxes: Floats) -> None:
    filled = 0
    for i in range(starts.shape[0] - 1):
        for t in coarse_to_fine(starts[i + 1] - starts[i]):
            for box in swept_bodies(load(states, starts[i] + t, vehicle), vehicle):
                for k in range(6):
                    boxes[filled, k] = box[k]
                filled += 1


def sweep_plans(plans: Sequence[Plan], vehicle: Vehicle = CAR) -> PlanSweeps:
    """Pack the swept boxes of ``plans``."""
    stored = store_plans(plans, state_size(vehicle))
    boxes = np.empty((body_count(vehicle) * len(stored.states), 6))
    _fill_sweeps(stored.states, stored.starts, vehicle, boxes)
    return sweeps_with(boxes, stored)


def sweeps_with(boxes: Floats, plans: StoredPlans) -> PlanSweeps:
    """The sweeps of ``plans`` whose boxes were made before; ValueError where there are too few or many."""
    bodies, rest = divmod(len(boxes), max(1, len(plans.states)))
    if rest or (len(boxes) > 0) != (bodies > 0):
        raise ValueError(f"{len(boxes)} swept boxes are none of {len(plans.states)} states")
    first, last = plans.states[plans.starts[:-1]], plans.states[plans.starts[1:] - 1]
    starts = (bodies * plans.starts).astype(np.int32)
    return PlanSweeps(boxes, starts, first[:, :3].copy(), last[:, :2].copy())


@inlined
def sweep_is_free(sweeps: PlanSweeps, i: int, scene: Scene) -> tuple[bool, int]:
    """Whether plan ``i``'s sweep is free in a scene, and how many boxes were checked to know."""
    boxes = sweeps.boxes
    for j in range(sweeps.starts[i], sweeps.starts[i + 1]):
        if not box_is_free(
            boxes[j, 0], boxes[j, 1], boxes[j, 2], boxes[j, 3], boxes[j, 4], boxes[j, 5], scene
        ):
            return False, j - sweeps.starts[i] + 1
    return True, sweeps.starts[i + 1] - sweeps.starts[i]


@jit
def free_plans(sweeps: PlanSweeps, scene: Scene) -> Flags:
    """Label vector ``[N]``: which plans' sweeps are free in a scene of the canonical frame."""
    free = np.empty(sweeps.starts.shape[0] - 1, np.bool_)
    for i in range(free.shape[0]):
        free[i], _ = sweep_is_free(sweeps, i, scene)
    return free


@inlined
def plan_joins(
    sweeps: PlanSweeps,
    i: int,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    goal_radius: float,
) -> bool:
    """Whether plan ``i`` begins at a start pose and ends in a goal disc."""
    if (
        abs(sweeps.first_poses[i, 0] - start[0]) > START_TOLERANCE
        or abs(sweeps.first_poses[i, 1] - start[1]) > START_TOLERANCE
        or abs(sweeps.first_poses[i, 2] - start[2]) > START_TOLERANCE
    ):
        return False
    last = sweeps.last_positions
    return math.hypot(last[i, 0] - goal[0], last[i, 1] - goal[1]) <= goal_radius


@inlined
def turned_box_is_free(
    boxes: Floats, j: int, px: float, py: float, cos: float, sin: float, scene: Scene
) -> bool:
    """Whether box ``j``, turned about (px, py) by an angle of that cosine and sine, is free."""
    dx = boxes[j, 0] - px
    dy = boxes[j, 1] - py
    return box_is_free(
        px + cos * dx - sin * dy,
        py + sin * dx + cos * dy,
        cos * boxes[j, 2] - sin * boxes[j, 3],
        sin * boxes[j, 2] + cos * boxes[j, 3],
        boxes[j, 4],
        boxes[j, 5],
        scene,
    )


@jit
def plan_is_free(
    sweeps: PlanSweeps,
    i: int,
    scene: Scene,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    goal_radius: float,
) -> tuple[bool, int]:
    """Whether plan ``i`` answers a problem: begins at its start, ends in its goal disc, and is free.

    Also how many footprints were checked to know.
    """
    if not plan_joins(sweeps, i, start, goal, goal_radius):
        return False, 0
    return sweep_is_free(sweeps, i, scene)


@jit
def turned_plan_is_free(
    sweeps: PlanSweeps,
    i: int,
    scene: Scene,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    goal_radius: float,
) -> tuple[bool, int]:
    """Like ``plan_is_free`` for plan ``i`` turned rigidly about its first position to the start's heading."""
    pose = sweeps.first_poses[i]
    px = pose[0]
    py = pose[1]
    if abs(px - start[0]) > START_TOLERANCE or abs(py - start[1]) > START_TOLERANCE:
        return False, 0
    cos = math.cos(start[2] - pose[2])
    sin = math.sin(start[2] - pose[2])
    dx = sweeps.last_positions[i, 0] - px
    dy = sweeps.last_positions[i, 1] - py
    if math.hypot(px + cos * dx - sin * dy - goal[0], py + sin * dx + cos * dy - goal[1]) > goal_radius:
        return False, 0
    for j in range(sweeps.starts[i], sweeps.starts[i + 1]):
        if not turned_box_is_free(sweeps.boxes, j, px, py, cos, sin, scene):
            return False, j - sweeps.starts[i] + 1
    return True, sweeps.starts[i + 1] - sweeps.starts[i]


@jit
def plan_answers(
    sweeps: PlanSweeps,
    i: int,
    scene: Scene,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    goal_radius: float,
) -> tuple[bool, int]:
    """Whether plan ``i``, turned to the start's heading if it has another, answers a problem; the checks."""
    if abs(sweeps.first_poses[i, 2] - start[2]) <= START_TOLERANCE:
        return plan_is_free(sweeps, i, scene, start, goal, goal_radius)
    return turned_plan_is_free(sweeps, i, scene, start, goal, goal_radius)


@jit
def first_answer(
    sweeps: PlanSweeps,
    order: Integers,
    scene: Scene,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    goal_radius: float,
) -> tuple[int, int]:
    """The first plan of ``order`` that answers a problem (-1: none), and how many footprints were checked."""
    checks = 0
    for i in order:
        free, checked = plan_answers(sweeps, i, scene, start, goal, goal_radius)
        checks += checked
        if free:
            return i, checks
    return -1, checks
