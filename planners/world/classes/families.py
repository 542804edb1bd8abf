"""The families of manoeuvres, each easy, standard or hard, drawn from a seed for any vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from planners.world.classes.parking import Aisle, Lot, draw_aisle, draw_lot
from planners.world.classes.problem_classes import DIFFICULTIES, ProblemClass, problem_class
from planners.world.classes.slots import Ground, Sizes, mirrored, sizes_of
from planners.world.classes.trains import Dock, Yard, draw_dock, draw_yard
from planners.world.problem import Arrival, Problem, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle, name_of, trailers_of

WITHOUT_TRAILERS: Final = ("parallel", "perpendicular", "angled", "lot")
WITH_TRAILERS: Final = ("dock", "yard")
FAMILIES: Final = (*WITHOUT_TRAILERS, *WITH_TRAILERS)

PARKED: Final = (0.05, math.radians(1.0))  # metres and radians of the world outside, off the goal pose
LAST_TRAILER: Final = (0.1, math.radians(2.0))  # what the last trailer may be off at worst

_SIDE: Final = (0.5 * math.pi, 0.5 * math.pi)
_OBLIQUE: Final = (math.radians(45.0), math.radians(70.0))
_SETTINGS: Final[dict[str, tuple[Callable[..., Ground], dict[str, Any]]]] = {  # what draws, with what
    "parallel": (
        draw_aisle,
        {
            "easy": Aisle(0.55, 1.55, 0.03, 0.1, 0.6, (0.0, 0.0), (-1.5, 2.5), 0.0, 0.0),
            "standard": Aisle(0.4, 1.2, 0.05, 0.2, 0.8, (0.0, 0.0), (-1.5, 2.5), 0.0, 0.0),
            "hard": Aisle(0.3, 1.1, 0.08, 0.3, 0.95, (0.0, 0.0), (-1.5, 2.5), 0.0, 0.0),
        },
    ),
    "perpendicular": (
        draw_aisle,
        {
            "easy": Aisle(0.42, 1.5, 0.03, 0.1, 0.6, _SIDE, (-2.5, 2.5), 0.5, 0.5),
            "standard": Aisle(0.3, 1.15, 0.05, 0.2, 0.8, _SIDE, (-2.5, 2.5), 0.5, 0.5),
            "hard": Aisle(0.2, 1.1, 0.08, 0.3, 0.95, _SIDE, (-2.5, 2.5), 0.5, 0.5),
        },
    ),
    "angled": (
        draw_aisle,
        {
            "easy": Aisle(0.4, 1.25, 0.03, 0.1, 0.6, _OBLIQUE, (-1.0, 3.0), 0.0, 0.0),
            "standard": Aisle(0.28, 1.1, 0.05, 0.2, 0.8, _OBLIQUE, (-1.0, 3.0), 0.25, 0.5),
            "hard": Aisle(0.2, 0.95, 0.08, 0.3, 0.95, _OBLIQUE, (-1.0, 3.0), 0.25, 0.5),
        },
    ),
    "lot": (
        draw_lot,
        {
            "easy": Lot(0.6, 1.8, 0.03, 0.6, (1, 2), (5, 8)),
            "standard": Lot(0.42, 1.5, 0.05, 0.8, (1, 2), (6, 10)),
            "hard": Lot(0.3, 1.25, 0.08, 0.95, (2, 3), (8, 12)),
        },
    ),
    "dock": (
        draw_dock,
        {
            "easy": Dock(0.9, 2.0, 0.02, 0.1, 0.6),
            "standard": Dock(0.6, 1.6, 0.03, 0.2, 0.8),
            "hard": Dock(0.4, 1.3, 0.04, 0.3, 0.95),
        },
    ),
    "yard": (
        draw_yard,
        {
            "easy": Yard(1.4, 2.5, 1.0, 0.4),
            "standard": Yard(1.15, 2.0, 0.5, 0.6),
            "hard": Yard(0.95, 1.6, 0.25, 0.8),
        },
    ),
}


@dataclass(frozen=True)
class Family:
    """A source of similar manoeuvres for a vehicle."""

    name: str
    difficulty: str
    vehicle: Vehicle
    settings: Aisle | Lot | Dock | Yard
    draw_ground: Callable[[Any, Sizes, np.random.Generator], Ground]

    def draw(self, seed: int, index: int) -> Problem:
        """Draw the problem number ``index`` of a seed, always the same one for the same vehicle.

        Start and goal are poses, at rest and all straight; lengths are those of the vehicle's problems.
        """
        rng = generator(seed, self.name, self.difficulty, index)
        ground = self.draw_ground(self.settings, sizes_of(self.vehicle), rng)
        if rng.random() < 0.5:
            ground = mirrored(ground)
        x, y, heading = ground.goal
        metres, radians = tolerances_of(self.vehicle)
        trailers = len(trailers_of(self.vehicle))
        return Problem(
            id=f"{self.name}-{self.difficulty}-{seed}-{index}",
            class_name=self.name,
            start=ground.start,
            goal=(x, y),
            goal_radius=metres / self.vehicle.scale,
            bounds=ground.bounds,
            obstacles=obstacles_of([[polygon] for polygon in ground.obstacles]),
            scale=self.vehicle.scale,
            arrival=Arrival(heading, radians, 0.0, 0.0, (0.0,) * trailers, (radians,) * trailers),
        )


def tolerances_of(vehicle: Vehicle) -> tuple[float, float]:
    """How far a vehicle may end from its goal pose: metres of the world outside, radians of each angle.

    With trailers half of what the last one may be off is left to the place. The angles of all bodies add up
    to what is left of both: it is 2 degrees off at most, and 10 cm to the first order.
    """
    trailers = trailers_of(vehicle)
    if not trailers:
        return PARKED
    metres, radians = LAST_TRAILER
    lever = sum((i + 2) * each.hitch_length for i, each in enumerate(trailers)) * vehicle.scale
    return 0.5 * metres, min(radians / (1 + len(trailers)), 0.5 * metres / lever)


def family(name: str, difficulty: str = "standard", vehicle: Vehicle = CAR) -> Family:
    """Return the family of that name and difficulty for a vehicle.

    Raises ValueError if there is none, or none for this vehicle: it has to drive backwards and to be able to
    stand, ``dock`` and ``yard`` are for vehicles with trailers and the others for those without.
    """
    if name not in FAMILIES:
        raise ValueError(f"Unknown family {name!r}; choose one of {', '.join(FAMILIES)}.")
    if difficulty not in DIFFICULTIES:
        raise ValueError(f"Unknown difficulty {difficulty!r}; choose one of {', '.join(DIFFICULTIES)}.")
    if vehicle.min_speed >= 0.0:
        raise ValueError(f"{name_of(vehicle)} cannot drive backwards, which manoeuvres need.")
    suited = families_of(vehicle)
    if name not in suited:
        other = f"or a vehicle {'without' if trailers_of(vehicle) else 'with'} trailers"
        raise ValueError(f"{name} is not for {name_of(vehicle)}; choose {', '.join(suited)}, {other}.")
    draw_ground, settings = _SETTINGS[name]
    return Family(name, difficulty, vehicle, settings[difficulty], draw_ground)


def families_of(vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the families for a vehicle; there is none if it cannot drive backwards and stand."""
    if vehicle.min_speed >= 0.0:
        return ()
    return WITH_TRAILERS if trailers_of(vehicle) else WITHOUT_TRAILERS


def class_or_family(name: str, difficulty: str, vehicle: Vehicle) -> ProblemClass | Family:
    """Return the class or the family of that name, as ``problem_class`` and ``family`` do."""
    return (family if name in FAMILIES else problem_class)(name, difficulty, vehicle)
