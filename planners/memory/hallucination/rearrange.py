"""The paper's method: obstacles near the plan move a little, all others are drawn anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.memory.hallucination import placing
from planners.memory.hallucination.method import DrawObstacles, Sampler
from planners.memory.plans.experience import Experience
from planners.world.jit import jit
from planners.world.obstacle_sets import first_obstacles, moved_obstacle, new_obstacles, take_obstacle
from planners.world.problem import Obstacles


@dataclass(frozen=True)
class Rearrange:
    """Keep the plan's surroundings apart from a jitter (Das et al., section III-B).

    An obstacle is near if it meets the plan's swept footprints widened by ``near_m`` on every side. The wider
    that is, the better an encoder can tell the origin from the other free plans (docs/training.md). What new
    problems look like it has to learn from draws of the class.
    """

    near_m: float = 8.0  # metres
    position_std_m: float = 0.3  # metres, in x and in y
    heading_std_rad: float = 0.05  # radians, about the obstacle's centre
    attempts: int = 20  # moves to try; if none is clear of the plan, the obstacle stays where it was

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Find the obstacles near the plan."""
        corridor = placing.corridor_of(experience)
        near = placing.obstacles_near(experience.problem.obstacles, corridor, self.near_m)

        def sample(draw: DrawObstacles, rng: np.random.Generator) -> Obstacles:
            return _rearranged(
                near,
                draw(rng),
                corridor,
                self.near_m,
                self.position_std_m,
                self.heading_std_rad,
                self.attempts,
                rng,
            )

        return sample


@jit
def _rearranged(
    near: Obstacles,
    fresh: Obstacles,
    corridor: placing.Corridor,
    near_m: float,
    position_std_m: float,
    heading_std_rad: float,
    attempts: int,
    rng: np.random.Generator,
) -> Obstacles:
    # An obstacle in the goal disc is never drawn anew: classes keep the disc free, but a folder of worlds may
    # not, and then the disc only ever gets emptier.
    result = new_obstacles(near, fresh)
    kept = near.obstacle_starts.shape[0] - 1
    for o in range(kept):
        for _ in range(attempts):
            dx = position_std_m * rng.standard_normal()
            dy = position_std_m * rng.standard_normal()
            moved_obstacle(near, o, dx, dy, heading_std_rad * rng.standard_normal(), result, o)
            if not placing.meets_corridor(result, o, corridor, 0.0):
                break
        else:
            take_obstacle(near, o, result, o)
    return first_obstacles(result, placing.add_clear(fresh, corridor, near_m, result, kept))
