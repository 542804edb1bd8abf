"""Routes through doors that are hardly wider than the vehicle, with and without a pose in the door.

``python -m tests.speed tight_doors [--doors 40] [--vehicles car docs/vehicles/forklift.yaml …] [--seed 701]``
draws oblique walls with one door, 1.03 to 1.3 times as wide as the vehicle and a cell of the map more, and
asks for a place behind. It prints how many routes are found, the seconds of processor time that they take
and those that are lost where none is found, and the driving time. The authority judges every route.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from time import process_time
from typing import Final, NamedTuple
from unittest import mock

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.attempt import Attempt
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.doors import Doors
from planners.routes.path_ahead import Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.search.query import Limits
from planners.solve import solve
from planners.world.arrays import Pose
from planners.world.authority.authority import faults
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle, name_of
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle

SIDE_M: Final = 24.0
VEHICLES: Final = (
    "car",
    "differential-drive",
    "car-1-trailer",
    "docs/vehicles/jackal.yaml",
    "docs/vehicles/hunter.yaml",
    "docs/vehicles/forklift.yaml",
)


class Asked(NamedTuple):
    """A map with a door, and a route through it."""

    world: OccupancyMap
    start: Pose
    goal: Stop


class Driven(NamedTuple):
    """What came of it."""

    found: bool
    seconds: float  # of processor time
    driving_s: float


def _drawn(seed: int, count: int, vehicle: Vehicle) -> Iterator[Asked]:
    rng = np.random.default_rng(seed)
    for number in range(count):
        cell = float(rng.choice([0.05, 0.1, 0.2]))
        share, angle = rng.uniform(1.03, 1.3), rng.uniform(-0.6, 0.6)
        thickness, off = rng.uniform(0.15, 0.8), rng.uniform(-4.0, 4.0)
        cells = round(SIDE_M / cell)
        y, x = cell * (np.indices((cells, cells)) + 0.5) - 0.5 * SIDE_M
        across = x * math.cos(angle) + y * math.sin(angle)
        along = y * math.cos(angle) - x * math.sin(angle)
        door = np.abs(along - off) < 0.5 * (share * vehicle.width + cell)
        wall = (np.abs(across) < 0.5 * thickness) & ~door
        start = rng.uniform(3.0, 8.0), rng.uniform(4.0, 20.0), rng.uniform(-math.pi, math.pi)
        goal = rng.uniform(16.0, 21.0), rng.uniform(4.0, 20.0)
        yield Asked(OccupancyMap(f"door-{number}", wall, cell), start, Stop(goal))


def _driven(asked: Asked, vehicle: Vehicle, workspace: Workspace) -> Driven | None:
    """One attempt; None if start or goal is occupied. Raises AssertionError for a refused route."""

    def solver(problem: Problem, limits: Limits) -> Attempt:
        return solve(problem, "lattice", "fresh", limits=limits, vehicle=vehicle, workspace=workspace)

    began = process_time()
    found = Router(asked.world, solver, vehicle).route(asked.start, [asked.goal])
    seconds = process_time() - began
    if isinstance(found, Route):
        plan = found.plan(vehicle)
        assert faults(found.problem, plan, vehicle) == []
        return Driven(True, seconds, plan.duration_s)
    return Driven(False, seconds, math.nan) if found.attempts else None


def _row(name: str, way: str, driven: list[Driven]) -> list[str]:
    seconds = np.array([each.seconds for each in driven if each.found])
    lost = np.array([each.seconds for each in driven if not each.found])
    driving = np.array([each.driving_s for each in driven if each.found])
    return [
        *(name, way, f"{len(seconds)} of {len(driven)}"),
        f"{seconds.mean():.2f}, {seconds.max():.2f}" if len(seconds) else "–",
        f"{lost.mean():.2f}" if len(lost) else "–",
        f"{driving.mean():.1f}" if len(driving) else "–",
    ]


def report(console: Console, doors: int = 40, vehicles: tuple[str, ...] = VEHICLES, seed: int = 701) -> None:
    """Print the table for so many ``doors`` of each of some ``vehicles``."""
    headings = ("vehicle", "pose in the door", "found", "s: mean, most", "s where none is", "driving s")
    table = Table(*headings, title=f"{doors} doors each, seed {seed}")
    for said in vehicles:
        vehicle, workspace = said_vehicle(said), Workspace()
        asked = list(_drawn(seed, doors, vehicle))
        _driven(asked[0], vehicle, workspace)  # compiles
        without: list[Driven] = []
        having: list[Driven] = []
        for each in asked:
            with mock.patch.object(Doors, "legs_through", return_value=None):
                plain = _driven(each, vehicle, workspace)
            led = _driven(each, vehicle, workspace)
            if plain is not None and led is not None:
                without.append(plain)
                having.append(led)
        for way, driven in (("no", without), ("yes", having)):
            table.add_row(*_row(name_of(vehicle), way, driven))
    console.print(table)


def main(arguments: list[str]) -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed tight_doors", description=__doc__)
    parser.add_argument("--doors", type=int, default=40)
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES))
    parser.add_argument("--seed", type=int, default=701)
    asked = parser.parse_args(arguments)
    report(Console(width=170), asked.doors, tuple(asked.vehicles), asked.seed)
