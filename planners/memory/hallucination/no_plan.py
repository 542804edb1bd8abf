"""Makes ``S_0``: problems that no stored plan solves, from which recall learns when to recall nothing."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.memory.hallucination.method import DrawObstacles
from planners.memory.hallucination.placing import obstacle_meets
from planners.memory.plans.free import free_plans, sweep_is_free
from planners.memory.plans.sweeps import PlanSweeps
from planners.world.arrays import Bounds, Flags, Floats
from planners.world.geometry.collision import build_scene
from planners.world.jit import jit
from planners.world.obstacle_sets import first_obstacles, new_obstacles, take_obstacle
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Obstacles, Problem

DRAWS: Final = 1000  # a class whose obstacles miss a plan so often can never block it


class NeverBlockedError(RuntimeError):
    """The obstacles of a class never block some plan, so each problem of the class has a plan."""


def no_plan(
    sweeps: PlanSweeps,
    draw: DrawObstacles,
    rng: np.random.Generator,
    class_name: str,
    index: int,
    bounds: Bounds = BOUNDS,
    scale: float = 1.0,
) -> Problem:
    """Make problem number ``index`` of ``S_0``: a draw of the class, and more obstacles to block every plan.

    Args:
        sweeps: the swept boxes of the stored plans.
        draw: draws obstacles of the class.
        rng: the source of all random choices.
        class_name: of the problem.
        index: the problem's number, for its id.
        bounds: x_min, y_min, x_max, y_max in metres.
        scale: how many metres of the vehicle's world are one of these.

    Raises:
        NeverBlockedError: The obstacles of the class never block some plan.
    """
    obstacles = draw(rng)
    everywhere = np.array(bounds)
    for _ in range(DRAWS):
        free = free_plans(sweeps, build_scene(obstacles.vertices, obstacles.piece_starts, everywhere))
        if not free.any():
            return Problem(
                id=f"{class_name}~no-plan-{index}",
                class_name=class_name,
                start=CANONICAL_START,
                goal=CANONICAL_GOAL,
                goal_radius=GOAL_RADIUS,
                bounds=bounds,
                obstacles=obstacles,
                scale=scale,
            )
        obstacles = _with_blocking(obstacles, draw(rng), sweeps, free, everywhere)
    raise NeverBlockedError(
        f"{DRAWS} draws of class {class_name} never blocked plans {np.flatnonzero(free).tolist()}"
    )


@jit
def _with_blocking(
    obstacles: Obstacles, extra: Obstacles, sweeps: PlanSweeps, free: Flags, bounds: Floats
) -> Obstacles:
    """Add to ``obstacles``, for each plan that is ``free [N]``, one of ``extra`` that blocks it, if any."""
    scene = build_scene(extra.vertices, extra.piece_starts, bounds)
    extras = extra.obstacle_starts.shape[0] - 1
    taken = np.zeros(extras, np.bool_)
    for i in range(free.shape[0]):
        if free[i]:
            unblocked, checked = sweep_is_free(sweeps, i, 1.0, 0.0, scene)
            if not unblocked:
                last = sweeps.starts[i] + checked
                blocked = sweeps.boxes[last - 1 : last].reshape((1, 1, 6))
                for o in range(extras):
                    if obstacle_meets(extra, o, blocked, 0.0, math.inf):
                        taken[o] = True
                        break
    result = new_obstacles(obstacles, extra)
    count = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        take_obstacle(obstacles, o, result, count)
        count += 1
    for o in range(extras):
        if taken[o]:
            take_obstacle(extra, o, result, count)
            count += 1
    return first_obstacles(result, count)
