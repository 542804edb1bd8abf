"""``S_0``: problems that no stored plan solves, so that recall learns when there is nothing to recall."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.memory.hallucination.method import DrawObstacles
from planners.memory.hallucination.placing import (
    first_obstacles,
    new_obstacles,
    obstacle_meets,
    take_obstacle,
)
from planners.memory.plans.fit import free_plans, sweep_is_free
from planners.memory.plans.sweeps import PlanSweeps
from planners.world.arrays import Flags, Floats
from planners.world.geometry.collision import build_scene
from planners.world.jit import jit
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Obstacles, Problem

DRAWS: Final = 1000  # a class whose obstacles miss a plan this often can never block it


def no_plan(
    sweeps: PlanSweeps,
    draw: DrawObstacles,
    rng: np.random.Generator,
    class_name: str,
    index: int,
    bounds: tuple[float, float, float, float] = BOUNDS,
) -> Problem:
    """Problem number ``index`` of ``S_0``: a class draw, and of more draws what it takes to block every plan.

    Raises RuntimeError when the class's obstacles never block some plan.
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
            )
        obstacles = _with_blocking(obstacles, draw(rng), sweeps, free, everywhere)
    raise RuntimeError(
        f"{DRAWS} draws of class {class_name} never blocked plans {np.flatnonzero(free).tolist()}: "
        "leave these plans out, or make the class harder"
    )


@jit
def _with_blocking(
    obstacles: Obstacles, extra: Obstacles, sweeps: PlanSweeps, free: Flags, bounds: Floats
) -> Obstacles:
    """``obstacles``, and for each plan that is ``free`` one of ``extra`` that blocks it, if any does."""
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
