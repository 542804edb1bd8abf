"""The problem classes, each easy, standard or hard, drawn from a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.classes.layouts import Curves, Random, Scatter, Trap, draw_curves, draw_random, draw_trap
from planners.world.classes.shapes import TRAILER_ROOM_M, without_those_near
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Obstacles, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Trailer, Vehicle, trailers_of

CLASSES: Final = ("curves", "random", "trap")
DIFFICULTIES: Final = ("easy", "standard", "hard")


# The figures beside each setting are measured (docs/decisions/0002-problem-classes.md): oracle@100; median
# and mean milliseconds of the best planner from scratch; collision checks of RRT, in those of an empty world.

_CURVES_STANDARD: Final = Curves(
    curves=4,
    inner_m=8.0,
    outer_m=26.5,
    segments=5,
    gap_m=4.75,
    slip_m=1.25,
    shift_m=0.5,
    presence=0.85,
    thickness_m=0.5,
    small=Scatter(sites=16, presence=0.85, jitter_m=1.25, radius_min_m=0.8, radius_max_m=1.8, strays=0),
)
_CURVES: Final = {
    # 1.000; 0.38, 0.43 ms; 5.3 x
    "easy": _CURVES_STANDARD._replace(curves=3, outer_m=24.0, gap_m=6.0, presence=0.8),
    # 0.934; 0.53, 0.62 ms; 8.6 x
    "standard": _CURVES_STANDARD,
    # 0.586; 0.90, 1.26 ms; 22.4 x
    "hard": _CURVES_STANDARD._replace(curves=5, inner_m=6.0, outer_m=29.0, gap_m=4.25),
}

_RANDOM_STANDARD: Final = Random(
    Scatter(sites=36, presence=0.97, jitter_m=0.5, radius_min_m=2.9, radius_max_m=4.2, strays=0)
)
_RANDOM: Final = {
    # 1.000; 0.34, 0.37 ms; 3.0 x
    "easy": Random(_RANDOM_STANDARD.shapes._replace(radius_min_m=1.8, radius_max_m=2.8)),
    # 0.968; 0.43, 0.50 ms; 5.6 x
    "standard": _RANDOM_STANDARD,
    # 0.734; 0.61, 0.72 ms; 7.6 x
    "hard": Random(_RANDOM_STANDARD.shapes._replace(sites=38, jitter_m=0.8, strays=2)),
}

_TRAP_STANDARD: Final = Trap(
    width_m=23.0,
    flank_m=15.0,
    gap_m=7.5,
    depth_m=12.0,
    thickness_m=1.0,
    jitter_m=2.5,
    turn=0.25,
    small=Scatter(sites=26, presence=0.85, jitter_m=2.0, radius_min_m=1.0, radius_max_m=2.5, strays=1),
)
_TRAP: Final = {
    # 0.996; 0.40, 0.44 ms; 5.1 x
    "easy": _TRAP_STANDARD._replace(width_m=18.0, flank_m=12.0, gap_m=9.0, depth_m=8.0),
    # 0.966; 0.47, 0.58 ms; 12.9 x
    "standard": _TRAP_STANDARD,
    # 0.854; 0.70, 3.31 ms; 29.7 x
    "hard": _TRAP_STANDARD._replace(width_m=26.0, flank_m=18.0, gap_m=6.0, depth_m=14.0),
}


_LAYOUTS: Final[dict[str, tuple[Any, Any]]] = {  # settings by difficulty, and what draws with them
    "curves": (_CURVES, draw_curves),
    "random": (_RANDOM, draw_random),
    "trap": (_TRAP, draw_trap),
}


@dataclass(frozen=True)
class ProblemClass:
    """A source of similar problems."""

    name: str
    difficulty: str
    layout: Curves | Random | Trap
    draw_obstacles: Callable[[np.random.Generator], Obstacles]
    scale: float = 1.0  # of the problems: metres of the world outside in one of theirs

    def draw(self, seed: int, index: int) -> Problem:
        """Draw the canonical problem number ``index`` of a seed, always the same one."""
        return Problem(
            id=f"{self.name}-{self.difficulty}-{seed}-{index}",
            class_name=self.name,
            start=CANONICAL_START,
            goal=CANONICAL_GOAL,
            goal_radius=GOAL_RADIUS,
            bounds=BOUNDS,
            obstacles=self.draw_obstacles(generator(seed, self.name, self.difficulty, index)),
            scale=self.scale,
        )


def problem_class(name: str, difficulty: str = "standard", vehicle: Vehicle = CAR) -> ProblemClass:
    """Return the class of that name and difficulty. Raises ValueError if there is none.

    All vehicles get the same draws, but obstacles near a trailer that stands straight behind the start are
    left out for the vehicle that has it.
    """
    if name not in CLASSES:
        raise ValueError(f"Unknown problem class {name!r}; choose one of {', '.join(CLASSES)}.")
    if difficulty not in DIFFICULTIES:
        raise ValueError(f"Unknown difficulty {difficulty!r}; choose one of {', '.join(DIFFICULTIES)}.")
    settings, draw_layout = _LAYOUTS[name]
    draw = partial(draw_layout, settings[difficulty])
    if trailers_of(vehicle):
        draw = partial(_draw_with_room, draw, _trailer_rooms(trailers_of(vehicle)))
    return ProblemClass(name, difficulty, settings[difficulty], draw, vehicle.scale)


def _draw_with_room(
    draw: Callable[[np.random.Generator], Obstacles], rooms: Floats, rng: np.random.Generator
) -> Obstacles:
    return without_those_near(draw(rng), rooms)


def _trailer_rooms(trailers: tuple[Trailer, ...]) -> Floats:
    """Discs ``[n, 3]`` (x, y, radius in metres) around the bodies of the trailers at the canonical start."""
    x, y, heading = CANONICAL_START
    ahead = np.array([0.5 * (trailer.front - trailer.rear) for trailer in trailers])
    behind = np.cumsum([trailer.hitch_length for trailer in trailers]) - ahead
    rooms: Floats = np.column_stack(
        (x - behind * np.cos(heading), y - behind * np.sin(heading), np.full(len(behind), TRAILER_ROOM_M))
    )
    return rooms
