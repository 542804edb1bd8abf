"""Minimal: only the obstacles that make the plan's detours necessary; the class fills the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planners.memory.hallucination import placing, shortcut
from planners.memory.hallucination.method import DrawObstacles, Range, Sampler
from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats, Point
from planners.world.classes.shapes import add_regular, finished, new_canvas
from planners.world.jit import jit
from planners.world.obstacle_sets import first_obstacles, new_obstacles, take_obstacle
from planners.world.problem import Obstacles


@dataclass(frozen=True)
class Minimal:
    """Block every shortcut, with no obstacle more than that needs (HLSD, Xiao, Liu and Stone 2021).

    As long as a disc as wide as the body finds a path that is shorter than the plan by more than the share
    ``saving``, a regular polygon is put on the path where it is farthest from the plan, as large as the sweep
    allows. Then all polygons that are not needed are taken away. A few such sets are made for each plan, and
    each problem has one of them and, clear of the plan, the obstacles of a new draw of the class.
    """

    saving: float = 0.1  # share of the plan's length that a shortcut may save
    clearance_m: Range = (0.1, 1.0)  # between the sweep and the polygons of a set
    radius_m: Range = (2.0, 5.0)  # of the largest polygon of a set
    smallest_m: float = 0.3  # radius; a shortcut stays open if not even this fits
    sets: int = 4  # for each plan
    near_m: float = 0.3  # distance that obstacles of the class keep from the sweep

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Make the sets of a plan."""
        corridor = placing.corridor_of(experience)
        sets = [self.obstacles(experience, rng) for _ in range(self.sets)]

        def sample(draw: DrawObstacles, rng: np.random.Generator) -> Obstacles:
            return placing.with_clear(sets[int(rng.integers(len(sets)))], draw(rng), corridor, self.near_m)

        return sample

    def obstacles(self, experience: Experience, rng: np.random.Generator) -> Obstacles:
        """Make one minimal set, without obstacles of the class."""
        problem, vehicle = experience.problem, experience.vehicle
        closed = shortcut.lattice(problem.bounds, vehicle.width)
        left = shortcut.distances_left(problem.goal, problem.goal_radius)
        limit = (1.0 - self.saving) * experience.plan.length_m
        return _needed(
            _blocking(
                experience.boxes.reshape(-1, 6),
                closed,
                problem.start[:2],
                left,
                limit,
                shortcut.inflated_radius(vehicle.width),
                rng.uniform(*self.clearance_m),
                rng.uniform(*self.radius_m),
                self.smallest_m,
                rng,
            ),
            closed,
            problem.start[:2],
            left,
            limit,
        )


@jit
def _blocking(
    boxes: Floats,
    closed: shortcut.Closed,
    start: Point,
    left: Floats,
    limit_m: float,
    inflated_m: float,
    clearance_m: float,
    largest_m: float,
    smallest_m: float,
    rng: np.random.Generator,
) -> Obstacles:
    """Put polygons on one shortcut after another, until none is left or none fits, and fill in ``closed``."""
    canvas = new_canvas()
    for bit in range(shortcut.MOST):
        path = shortcut.shortest_path(closed, 0, start, left, limit_m)
        room = 0.0
        x = 0.0
        y = 0.0
        for point in path.points:
            px, py = shortcut.position(point)
            here = min(left[point], placing.clear_of(px, py, boxes, room))
            if here > room:
                room = here
                x = px
                y = py
        radius = min(largest_m, room - clearance_m)
        if radius < smallest_m:  # or there is no path
            break
        sides = int(rng.integers(5, 11))
        add_regular(canvas, x, y, 2.0 * math.pi * rng.random(), radius, sides)
        canvas.counts[1] += 1
        canvas.obstacle_starts[bit + 1] = canvas.counts[0]
        polygon = Obstacles(canvas.vertices, canvas.piece_starts, canvas.obstacle_starts)
        shortcut.close_around(polygon, bit, inflated_m, bit, closed)
    return finished(canvas)


@jit
def _needed(
    obstacles: Obstacles, closed: shortcut.Closed, start: Point, left: Floats, limit_m: float
) -> Obstacles:
    """Keep the obstacles without which there would be a shorter path; obstacle k has bit k in ``closed``.

    One pass is enough, because an obstacle that is needed is still needed when others are taken away.
    """
    limit_m = min(limit_m, shortcut.shortest_path(closed, 0, start, left, limit_m).length_m)
    result = new_obstacles(obstacles, obstacles)
    spared = np.int64(0)
    count = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        without = spared | (np.int64(1) << np.int64(o))
        if shortcut.shortest_path(closed, int(without), start, left, limit_m).length_m < limit_m:
            take_obstacle(obstacles, o, result, count)
            count += 1
        else:
            spared = without
    return first_obstacles(result, count)
