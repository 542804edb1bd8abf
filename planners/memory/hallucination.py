"""Problems that a stored plan solves (``METHODS``), and problems that no stored plan solves (``no_plan``)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from planners.memory.experience import Experience
from planners.memory.labels import Flags, PlanSweeps, free_plans, plan_is_free
from planners.memory.placing import largest_stride, moved_obstacle, obstacle_meets, take_obstacle
from planners.world.collision import scene_of
from planners.world.jit import jit
from planners.world.problem import (
    BOUNDS,
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    Floats,
    Obstacles,
    Problem,
)

DrawObstacles = Callable[[np.random.Generator], Obstacles]  # a fresh set of obstacles of the class
Hallucinator = Callable[[Experience, DrawObstacles, np.random.Generator], Obstacles]

NO_PLAN_DRAWS = 1000  # a class whose obstacles miss a plan this often can never block it


@dataclass(frozen=True)
class Rearrange:
    """The paper's method: near obstacles move a little, all others are drawn afresh.

    An obstacle is near when it meets the plan's swept footprints widened by ``near_m`` on every side. The
    wider that is, the better the origin can be told from the other plans that are free (docs/training.md);
    what new problems look like an encoder has to learn from draws of the class beside these.
    """

    near_m: float = 5.0  # metres
    position_std_m: float = 0.3  # metres, in x and in y
    heading_std_rad: float = 0.05  # radians, about the obstacle's centre
    attempts: int = 20  # moves tried until one is clear of the plan; then the obstacle stays where it was

    def __call__(self, experience: Experience, draw: DrawObstacles, rng: np.random.Generator) -> Obstacles:
        """Obstacles of one new problem that the experience's plan solves."""
        problem = experience.problem
        goal_box = np.array([*problem.goal, 1.0, 0.0, problem.goal_radius, problem.goal_radius])
        return _rearranged(
            problem.obstacles,
            draw(rng),
            experience.boxes,
            goal_box.reshape(1, 1, 6),
            self.near_m,
            self.position_std_m,
            self.heading_std_rad,
            self.attempts,
            rng,
        )


METHODS: Final[dict[str, Hallucinator]] = {"rearrange": Rearrange()}


def hallucinate(
    method: str, experience: Experience, draw: DrawObstacles, rng: np.random.Generator, index: int
) -> Problem:
    """Problem number ``index`` that ``method`` makes for the experience's plan, checked to be solved by it.

    ``draw`` gives fresh obstacles of the class. Unknown method: ValueError. An experience whose plan does not
    solve its own problem, and a method that breaks its promise: RuntimeError.
    """
    if method not in METHODS:
        raise ValueError(f"Unknown hallucination method {method!r}; choose one of {', '.join(METHODS)}.")
    origin = experience.problem
    problem = Problem(
        id=f"{origin.id}~{method}-{index}",
        class_name=origin.class_name,
        start=origin.start,
        goal=origin.goal,
        goal_radius=origin.goal_radius,
        bounds=origin.bounds,
        obstacles=METHODS[method](experience, draw, rng),
    )
    scene = scene_of(problem)
    free, _ = plan_is_free(experience.sweep, 0, scene, problem.start, problem.goal, problem.goal_radius)
    if not free:
        raise RuntimeError(
            f"{problem.id}: the plan it was made for does not solve it. Does the plan solve {origin.id}?"
        )
    return problem


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
    free: Flags = np.ones(len(sweeps.starts) - 1, np.bool_)
    for _ in range(NO_PLAN_DRAWS):
        problem = Problem(
            id=f"{class_name}~no-plan-{index}",
            class_name=class_name,
            start=CANONICAL_START,
            goal=CANONICAL_GOAL,
            goal_radius=GOAL_RADIUS,
            bounds=bounds,
            obstacles=obstacles,
        )
        free = free_plans(sweeps, scene_of(problem))
        if not free.any():
            return problem
        obstacles = _with_blocking(obstacles, draw(rng), sweeps, free)
    raise RuntimeError(
        f"{NO_PLAN_DRAWS} draws of class {class_name} never blocked plans {np.flatnonzero(free).tolist()}: "
        "leave these plans out, or make the class harder"
    )


@jit
def _rearranged(
    origin: Obstacles,
    fresh: Obstacles,
    boxes: Floats,
    goal_box: Floats,
    near_m: float,
    position_std_m: float,
    heading_std_rad: float,
    attempts: int,
    rng: np.random.Generator,
) -> Obstacles:
    # An obstacle that sits in the goal disc is not drawn anew: the class keeps the disc free by itself, but a
    # folder of worlds need not, and there the disc is only ever made emptier.
    vertices = np.empty((origin.vertices.shape[0] + fresh.vertices.shape[0], 2))
    piece_starts = np.zeros(origin.piece_starts.shape[0] + fresh.piece_starts.shape[0], np.int32)
    obstacle_starts = np.zeros(origin.obstacle_starts.shape[0] + fresh.obstacle_starts.shape[0], np.int32)
    result = Obstacles(vertices, piece_starts, obstacle_starts)
    stride_m = largest_stride(boxes)
    count = 0
    for o in range(origin.obstacle_starts.shape[0] - 1):
        take_obstacle(origin, o, result, count)
        if not obstacle_meets(result, count, boxes, near_m, stride_m):
            continue
        for _ in range(attempts):
            dx = position_std_m * rng.standard_normal()
            dy = position_std_m * rng.standard_normal()
            moved_obstacle(origin, o, dx, dy, heading_std_rad * rng.standard_normal(), result, count)
            if not (
                obstacle_meets(result, count, boxes, 0.0, stride_m)
                or obstacle_meets(result, count, goal_box, 0.0, stride_m)
            ):
                break
        else:
            take_obstacle(origin, o, result, count)
        count += 1
    for o in range(fresh.obstacle_starts.shape[0] - 1):
        take_obstacle(fresh, o, result, count)
        if not (
            obstacle_meets(result, count, boxes, near_m, stride_m)
            or obstacle_meets(result, count, goal_box, 0.0, stride_m)
        ):
            count += 1
    return _first_obstacles(result, count)


@jit
def _with_blocking(obstacles: Obstacles, extra: Obstacles, sweeps: PlanSweeps, free: Flags) -> Obstacles:
    """``obstacles`` and those of ``extra`` that block a plan which is ``free`` (updated in place)."""
    vertices = np.empty((obstacles.vertices.shape[0] + extra.vertices.shape[0], 2))
    piece_starts = np.zeros(obstacles.piece_starts.shape[0] + extra.piece_starts.shape[0], np.int32)
    obstacle_starts = np.zeros(obstacles.obstacle_starts.shape[0] + extra.obstacle_starts.shape[0], np.int32)
    result = Obstacles(vertices, piece_starts, obstacle_starts)
    count = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        take_obstacle(obstacles, o, result, count)
        count += 1
    for o in range(extra.obstacle_starts.shape[0] - 1):
        take_obstacle(extra, o, result, count)
        blocks = False
        for i in range(free.shape[0]):
            if free[i]:
                boxes = sweeps.boxes[sweeps.starts[i] : sweeps.starts[i + 1]].reshape((-1, 1, 6))
                if obstacle_meets(result, count, boxes, 0.0, math.inf):
                    free[i] = False
                    blocks = True
        if blocks:
            count += 1
    return _first_obstacles(result, count)


@jit
def _first_obstacles(obstacles: Obstacles, count: int) -> Obstacles:
    pieces = obstacles.obstacle_starts[count]
    return Obstacles(
        obstacles.vertices[: obstacles.piece_starts[pieces]].copy(),
        obstacles.piece_starts[: pieces + 1].copy(),
        obstacles.obstacle_starts[: count + 1].copy(),
    )
