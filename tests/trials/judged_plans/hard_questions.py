"""General questions with hard corners: any motion within the limits, any kind of goal, at any distance."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np

from planners.maps.questions import question_in
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES, problem_class
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Arrival, Problem
from planners.world.problem_faults import problem_fault
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import turn_limit
from planners.world.vehicles.vehicle import Vehicle, name_of, state_size, trailers_of
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import PARTS, Part, source_at
from tests.worlds import SHARED

CITIES: Final = sorted(file.stem for file in (SHARED / "maps").glob("*.map"))
WINDOWS: Final = 100  # of a city
RADII_M: Final = (2.0, 2.0, 10.0, 0.3, 0.02)
TOLERANCES: Final = ((0.1, 0.05), (0.1, 0.05), (1.0, 3.2), (0.3, 0.01), (0.01, 0.3), (0.01, 0.01))  # m, rad
HITCH_TOLERANCES: Final = (0.02, 0.1, 0.5)  # rad
NEAR_M: Final = (0.01, 5.0)
TRIES: Final = 5  # to place a near pose


@cache
def _windows(city: str, part: Part, seed: int) -> list[Problem]:
    source = source_at(SHARED / "maps" / f"{city}.map")
    return import_part(source, part, ImportSettings(count=WINDOWS, seed=seed, resolution=1.0)).problems


def world_of(seed: int, index: int, vehicle: Vehicle, part: Part) -> Problem:
    """World number ``index``: of the classes and city maps in turn. Each part has worlds of its own."""
    worlds = len(CLASSES) + len(CITIES)
    number, turn = divmod(index, worlds)
    if turn < len(CLASSES):
        difficulty = DIFFICULTIES[number % len(DIFFICULTIES)]
        return problem_class(CLASSES[turn], difficulty, vehicle).draw(seed + PARTS.index(part), index)
    windows = _windows(CITIES[turn - len(CLASSES)], part, seed)
    return replace(windows[number % len(windows)], scale=vehicle.scale)


def question_of(seed: int, index: int, vehicle: Vehicle, part: Part = "test") -> Problem | None:
    """Question number ``index``, or None if there is no room for it in its world."""
    rng = generator(seed, "hard question", index, part, name_of(vehicle))
    drawn = question_in(world_of(seed, index, vehicle, part), index, seed, vehicle, rng.random() < 0.5)
    if drawn is None:
        return None
    asked = _arriving(_placed(_moving(drawn, rng, vehicle), rng, vehicle), rng, vehicle)
    return asked if problem_fault(asked, vehicle) is None else None


def kind_of(asked: Problem) -> str:
    """What is asked at the goal, in a few words."""
    arrival = asked.arrival
    place = "place" if arrival is None or arrival.heading is None else "pose"
    if arrival is None or (arrival.least_speed, arrival.most_speed) == (-math.inf, math.inf):
        return f"{place}, any speed"
    return f"{place}, at rest" if arrival.least_speed == arrival.most_speed == 0.0 else f"{place}, a speed"


def _moving(asked: Problem, rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """The question as drawn, from rest, or at the limits of the vehicle's motion, even too fast to brake."""
    how = rng.integers(4)
    if how == 0:
        return replace(asked, start_motion=())
    if how == 1:
        speed = float(rng.choice([vehicle.min_speed, vehicle.max_speed]))
        turn = turn_limit(vehicle) * float(rng.choice([-1.0, 0.0, 1.0]))
        bent = [float(rng.uniform(-1.0, 1.0)) * each.max_hitch for each in trailers_of(vehicle)]
        return replace(asked, start_motion=(speed, turn, *bent))
    return asked


def _placed(asked: Problem, rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """The question with its goal as drawn, very near the start, at it, or at the edge of the bounds."""
    how = rng.integers(8)
    (x, y, start_heading), arrival, scene = asked.start, asked.arrival, scene_of(asked)
    if how == 0:
        return replace(asked, goal=(x, y), arrival=arrival and arrival._replace(heading=start_heading))
    if how == 1:
        low_x, low_y, high_x, high_y = asked.bounds
        inside = math.exp(rng.uniform(math.log(0.01), math.log(2.0)))
        edge = (float(rng.choice([low_x + inside, high_x - inside])), asked.goal[1])
        if rng.random() < 0.5:
            edge = (asked.goal[0], float(rng.choice([low_y + inside, high_y - inside])))
        return replace(asked, goal=edge)
    if how >= 4:
        return asked
    for _ in range(TRIES):
        metres = math.exp(rng.uniform(math.log(NEAR_M[0]), math.log(NEAR_M[1])))
        bearing, heading = rng.uniform(-math.pi, math.pi, 2).tolist()
        pose = np.zeros((1, state_size(vehicle)))
        pose[0, :3] = x + metres * math.cos(bearing), y + metres * math.sin(bearing), heading
        if arrival is None or count_free_prefix(pose, vehicle, scene):
            goal = float(pose[0, 0]), float(pose[0, 1])
            return replace(asked, goal=goal, arrival=arrival and arrival._replace(heading=heading))
    return asked


def _arriving(asked: Problem, rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """The question with other tolerances, speeds and hitch angles at its goal."""
    arrival = asked.arrival or Arrival()
    radius = RADII_M[rng.integers(len(RADII_M))]
    if arrival.heading is not None:
        radius, radians = TOLERANCES[rng.integers(len(TOLERANCES))]
        arrival = arrival._replace(heading_tolerance=radians)
    low, high = vehicle.min_speed, vehicle.max_speed
    how = rng.integers(6)
    if how == 0:
        speeds = sorted(rng.uniform(low, high, 2).tolist())
    elif how == 1:
        speeds = [float(rng.uniform(low, high))] * 2
    elif how == 2 or (arrival.heading is None and how < 5) or low > 0.0:
        speeds = [-math.inf, math.inf]
    else:
        speeds = [0.0, 0.0]
    arrival = arrival._replace(least_speed=speeds[0], most_speed=speeds[1])
    trailers = trailers_of(vehicle)
    if trailers and rng.random() < 0.3:
        hitches = tuple(
            float(rng.choice([0.0, 0.5 * rng.uniform(-1, 1)])) * each.max_hitch for each in trailers
        )
        tolerances = (HITCH_TOLERANCES[rng.integers(len(HITCH_TOLERANCES))],) * len(trailers)
        arrival = arrival._replace(hitches=hitches, hitch_tolerances=tolerances)
    return replace(asked, goal_radius=radius, arrival=None if arrival == Arrival() else arrival)
