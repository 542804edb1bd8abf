"""Minimal: the fewest obstacles that make the plan's detours worth while; the class fills the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planners.memory.hallucination.method import DrawObstacles, Sampler
from planners.memory.hallucination.placing import (
    clear_of,
    corridor_of,
    first_obstacles,
    new_obstacles,
    take_obstacle,
    with_clear,
)
from planners.memory.hallucination.shortcut import (
    MOST,
    Closed,
    close_around,
    inflated_radius,
    lattice,
    place,
    shortest_way,
    ways_left,
)
from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats
from planners.world.classes.shapes import add_regular, finished, new_canvas
from planners.world.jit import jit
from planners.world.problem import Obstacles

Range = tuple[float, float]  # drawn evenly from it, anew for each set


@dataclass(frozen=True)
class Minimal:
    """Block every shortcut, and only with what is needed for it (HLSD, Xiao, Liu and Stone 2021).

    As long as a disc as wide as the body finds a way that is shorter than the plan by more than the share
    ``saving``, a regular polygon is put on it where it is farthest from the plan, as large as the sweep
    allows. Then whatever can be spared is taken away. Such sets are made once a plan; each problem takes one
    of them and, clear of the plan, the obstacles of a fresh draw of the class.
    """

    saving: float = 0.1  # share of the plan's length that a shortcut may save
    clearance_m: Range = (0.1, 1.0)  # between the sweep and the polygons
    radius_m: Range = (2.0, 5.0)  # of the largest polygon
    smallest_m: float = 0.3  # radius; where no larger one fits, shortcuts stay
    sets: int = 4  # a plan
    near_m: float = 0.3  # obstacles of the class stay that clear of the sweep

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Make the sets for a plan."""
        corridor = corridor_of(experience)
        sets = [self.obstacles(experience, rng) for _ in range(self.sets)]

        def sample(draw: DrawObstacles, rng: np.random.Generator) -> Obstacles:
            return with_clear(sets[int(rng.integers(len(sets)))], draw(rng), corridor, self.near_m)

        return sample

    def obstacles(self, experience: Experience, rng: np.random.Generator) -> Obstacles:
        """One minimal set, without the class's obstacles."""
        problem, vehicle = experience.problem, experience.vehicle
        closed = lattice(problem.bounds, vehicle.width)
        left = ways_left(problem.goal, problem.goal_radius)
        limit = (1.0 - self.saving) * experience.plan.length_m
        return _needed(
            _blocking(
                experience.boxes.reshape(-1, 6),
                closed,
                problem.start[:2],
                left,
                limit,
                inflated_radius(vehicle.width),
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
    closed: Closed,
    start: tuple[float, float],
    left: Floats,
    limit_m: float,
    inflated_m: float,
    clearance_m: float,
    largest_m: float,
    smallest_m: float,
    rng: np.random.Generator,
) -> Obstacles:
    """Polygons on one shortcut after another, until none is left or none fits; ``closed`` is filled in."""
    canvas = new_canvas()
    for bit in range(MOST):
        way = shortest_way(closed, 0, start, left, limit_m)
        room = 0.0
        x = 0.0
        y = 0.0
        for point in way.points:
            px, py = place(point)
            here = min(left[point], clear_of(px, py, boxes, room))
            if here > room:
                room = here
                x = px
                y = py
        radius = min(largest_m, room - clearance_m)
        if radius < smallest_m:  # or there was no way
            break
        sides = int(rng.integers(5, 11))
        add_regular(canvas, x, y, 2.0 * math.pi * rng.random(), radius, sides)
        canvas.counts[1] += 1
        canvas.obstacle_starts[bit + 1] = canvas.counts[0]
        polygon = Obstacles(canvas.vertices, canvas.piece_starts, canvas.obstacle_starts)
        close_around(polygon, bit, inflated_m, bit, closed)
    return finished(canvas)


@jit
def _needed(
    obstacles: Obstacles,
    closed: Closed,
    start: tuple[float, float],
    left: Floats,
    limit_m: float,
) -> Obstacles:
    """Those without which there is a shorter way than with all; obstacle k has bit k in ``closed``.

    One pass is enough: with fewer obstacles around it, an obstacle that is needed stays so.
    """
    limit_m = min(limit_m, shortest_way(closed, 0, start, left, limit_m).length_m)
    result = new_obstacles(obstacles, obstacles)
    spared = np.int64(0)
    count = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        without = spared | (np.int64(1) << np.int64(o))
        if shortest_way(closed, int(without), start, left, limit_m).length_m < limit_m:
            take_obstacle(obstacles, o, result, count)
            count += 1
        else:
            spared = without
    return first_obstacles(result, count)
