"""How planning ends within a limit of time: how late it is, how often it has a plan, and how good that is.

``python -m tests.speed.time_limits`` has the lattice plan for new problems, each once within each limit, with
cold caches: places in a class, poses in slots, and a yard in which a train turns round. With ``--memory
LIBRARY`` it plans with this library, too, for the problems of its vehicle to poses. Driving times are those
without a limit and a memory, and how much longer other plans are driven, by mean over those that are found.
Problems have a seed of their own.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from planners.attempt import Attempt
from planners.memory.library.plan_library import PlanLibrary
from planners.search.query import usual_limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library, vehicle_of
from tasks.attempts.side_by_side import in_turn

SEED: Final = 81
TRAP: Final = "trap"
LIMITS_S: Final = (3.0, 1.0, 0.3, 0.1, 0.03, 0.01, 0.005, 0.002)
ASKED: Final = (
    (TRAP, "car", 60, LIMITS_S[4:]),
    ("perpendicular", "car", 40, LIMITS_S[2:7]),
    ("yard", "car-1-trailer", 20, LIMITS_S[1:6]),
)


class Way(NamedTuple):
    """How a problem is planned for."""

    limit_s: float | None
    memory: PlanLibrary | None


def main(arguments: Sequence[str] = ()) -> None:
    """Print the table in this terminal."""
    parser = ArgumentParser("python -m tests.speed.time_limits")
    parser.add_argument("--memory", type=Path)
    folder = parser.parse_args(arguments).memory
    report(Console(width=150), None if folder is None else load_library(folder, vehicle_of(folder)))


def report(console: Console, memory: PlanLibrary | None = None) -> None:
    """Print a line for each kind of problem and each limit."""
    table = Table(title="The lattice within limits of time", box=SIMPLE_HEAD, title_justify="left")
    for heading in (
        "problems",
        "vehicle",
        "memory",
        "limit ms",
        "median ms",
        "90 % ms",
        "worst ms",
        "solved",
        "drives s",
    ):
        table.add_column(heading, justify="right")
    for name, driver, count, limits in ASKED:
        vehicle = VEHICLES[driver]
        ways = [Way(limit, None) for limit in (None, *limits)]
        if memory is not None and memory.vehicle == vehicle and name != TRAP:
            ways += [way._replace(memory=memory) for way in ways]
        attempts = _attempts([_problem(name, vehicle, i) for i in range(count)], vehicle, ways)
        usual = [attempts[i, 0].duration_s for i in range(count)]
        for number, way in enumerate(ways):
            made = [attempts[i, number] for i in range(count)]
            took = 1e3 * np.array([attempt.planning_seconds for attempt in made])
            longer = [
                each.duration_s - least
                for each, least in zip(made, usual, strict=True)
                if each.duration_s is not None and least is not None
            ]
            drives = np.mean([least for least in usual if least is not None])
            table.add_row(
                *(name, driver, "none" if way.memory is None else f"{len(way.memory)} plans"),
                "none" if way.limit_s is None else f"{1e3 * way.limit_s:g}",
                *(f"{value:.1f}" for value in (np.median(took), np.quantile(took, 0.9), took.max())),
                f"{sum(attempt.solved for attempt in made)} of {count}",
                f"{drives:.2f}" if number == 0 else f"{np.mean(longer):+.2f}" if longer else "-",
            )
    console.print(table)


def _problem(name: str, vehicle: Vehicle, index: int) -> Problem:
    if name == TRAP:
        return problem_class(name).draw(SEED, index)
    return to_canonical(family(name, "standard", vehicle).draw(SEED, index))[0]


def _attempts(
    problems: Sequence[Problem], vehicle: Vehicle, ways: Sequence[Way]
) -> dict[tuple[int, int], Attempt]:
    workspace = Workspace()

    def attempt(problem: Problem, number: int) -> Attempt:
        seconds, memory = ways[number]
        return solve(
            *(problem, "lattice", "none" if memory is None else "repair", 5, memory),
            limits=usual_limits(problem, seconds),
            vehicle=vehicle,
            workspace=workspace,
        )

    for way in range(len(ways)):  # anything compiled or made on first use exists before time counts
        attempt(problems[0], way)
    for memory in {way.memory for way in ways if way.memory is not None}:
        _ = memory.sub_plans, memory.stretches, memory.endings
    return in_turn(problems, len(ways), SEED, attempt)


if __name__ == "__main__":
    main(sys.argv[1:])
