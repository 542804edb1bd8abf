"""Robots beside a route that they drive, with a limit of time: who gets one, how soon, and how late it is.

``python -m tests.speed beside_routes [--tours 3] [--places 10] [--vehicles car …] [--limits 0.05 0.2 1.0]
[--seed 501]`` draws tours of three places and a pose over a town, and on each some moments, in which the
robot is beside its plan by normal noise in metres and radians, or by 1 cm while a box of a metre has come to
stand on its route, 4 to 15 s ahead. It hands in its plan. The judge looks at each route.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Final, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.attempt import Attempt
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.search.query import Limits
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.problem import POSE_RADIUS, POSE_TOLERANCE, Arrival, Plan, Problem
from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.vehicles.vehicle_files import said_vehicle
from tests.planners.maps.samples import town

VEHICLES: Final = ("car", "differential-drive", "car-1-trailer")
CASES: Final = (("1 cm off", 0.01, False), ("5 cm off", 0.05, False), ("a box on the route", 0.01, True))
HEADINGS: Final = (
    *("vehicle", "limit, s", "the robot", "get a route", "later than left, s: mean, most"),
    "s, median, most",
)
AHEAD: Final = (40, 150)  # steps from the robot to the box
APART_M: Final = 4.0  # from there to where the robot stops, and 1.5 times as far to the robot


WORLD: Final = town(size=200)


class Tour(NamedTuple):
    """A route through stops, and the steps at which it stops."""

    stops: list[Stop]
    plan: Plan
    ends: list[int]


def _searched(problem: Problem, limits: Limits, vehicle: Vehicle) -> Attempt:
    return solve(problem, "lattice", limits=limits, vehicle=vehicle)


def _router(world: OccupancyMap, vehicle: Vehicle) -> Router:
    return Router(world, partial(_searched, vehicle=vehicle), vehicle)


def _with_box(state: Floats) -> OccupancyMap:
    occupied = WORLD.occupied.copy()
    occupied[int(state[1]), int(state[0])] = True
    return replace(WORLD, occupied=occupied)


def _is_near_stop(tour: Tour, at: int, on: int) -> bool:
    """Whether state ``on`` of a tour is near a stop or the robot, in state ``at``, or behind the end."""
    if on >= tour.ends[-1]:
        return True
    place = tour.plan.states[on, :2]
    away = min(math.dist(place, stop.place) for stop in tour.stops)
    return away < APART_M or math.dist(place, tour.plan.states[at, :2]) < 1.5 * APART_M


def _tour(router: Router, rng: np.random.Generator, vehicle: Vehicle) -> Tour:
    while True:
        places = [tuple(each) for each in rng.uniform(5.0, 195.0, (5, 2)).tolist()]
        arrival = Arrival(float(rng.uniform(-math.pi, math.pi)), POSE_TOLERANCE, 0.0, 0.0)
        stops = [*map(Stop, places[1:4]), Stop(places[4], POSE_RADIUS, arrival)]
        start = (*places[0], float(rng.uniform(-math.pi, math.pi)))
        route = router.route(start, stops, time_limit=20.0)
        if isinstance(route, Route):
            steps = [sum(len(leg.controls) for leg in section) for section in route.sections]
            return Tour(stops, route.plan(vehicle), np.cumsum(steps).tolist())


def report(
    console: Console,
    tours: int = 3,
    places: int = 10,
    vehicles: tuple[str, ...] = VEHICLES,
    limits: tuple[float, ...] = (0.05, 0.2, 1.0),
    seed: int = 501,
) -> None:
    """Print the table for so many ``tours``, and ``places`` on each, of some ``vehicles``."""
    table = Table(*HEADINGS, title=f"{tours} tours each, {places} moments on each, seed {seed}")
    for said in vehicles:
        vehicle, rng = said_vehicle(said), np.random.default_rng(seed)
        driver = _router(WORLD, vehicle)
        driven = [_tour(driver, rng, vehicle) for _ in range(tours)]
        moments = []
        for tour in driven:
            for _ in range(places):
                at = int(rng.uniform(0.0, 0.95) * tour.ends[-1])
                moments.append((tour, at, at + int(rng.integers(*AHEAD))))
        offs = rng.normal(size=(len(moments), 3))
        for limit in limits:
            for name, noise, blocked in CASES:
                later, seconds = [], []
                for (tour, at, on), off in zip(moments, offs, strict=True):
                    if blocked and _is_near_stop(tour, at, on):
                        continue
                    state = tour.plan.states[at].copy()
                    state[:3] += noise * off
                    x, y, heading, *motion = state.tolist()
                    left = tour.stops[sum(end <= at for end in tour.ends) :]
                    router = driver if not blocked else _router(_with_box(tour.plan.states[on]), vehicle)
                    began = perf_counter()
                    route = router.route((x, y, heading), left, tuple(motion), limit, tour.plan)
                    seconds.append(perf_counter() - began)
                    if isinstance(route, Route):
                        plan = route.plan(vehicle)
                        assert faults(route.problem, plan, vehicle) == []
                        later.append(vehicle.dt * (len(plan.controls) - (tour.ends[-1] - at)))
                table.add_row(
                    *(name_of(vehicle), f"{limit:g}", name, f"{len(later)} of {len(seconds)}"),
                    f"{np.mean(later):.2f}, {max(later):.1f}" if later else "",
                    f"{np.median(seconds):.2f}, {max(seconds):.2f}",
                )
    console.print(table)


def main(arguments: list[str]) -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed beside_routes", description=__doc__)
    parser.add_argument("--tours", type=int, default=3)
    parser.add_argument("--places", type=int, default=10)
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES))
    parser.add_argument("--limits", nargs="+", type=float, default=[0.05, 0.2, 1.0])
    parser.add_argument("--seed", type=int, default=501)
    asked = parser.parse_args(arguments)
    report(
        Console(width=170), asked.tours, asked.places, tuple(asked.vehicles), tuple(asked.limits), asked.seed
    )
