"""How planning ends within a limit of time: how late it is, how often it has a plan, and how good that is.

``python -m tests.speed.time_limits`` has the lattice plan for new problems, each once within each limit, with
cold caches: places in a class, poses in slots, and a yard in which a train turns round. Driving times are
of the problems that were solved within every limit of their line. Problems have a seed of their own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from planners.attempt import Attempt
from planners.search.query import usual_limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import VEHICLES
from planners.world.workspace import Workspace
from tasks.attempts.side_by_side import in_turn

SEED: Final = 81
LIMITS_S: Final = (3.0, 1.0, 0.3, 0.1, 0.03, 0.01, 0.005, 0.002)
ASKED: Final = (
    ("trap", "car", 60, LIMITS_S[4:]),
    ("perpendicular", "car", 40, LIMITS_S[2:7]),
    ("yard", "car-1-trailer", 20, LIMITS_S[1:6]),
)


def main() -> None:
    """Print the table in this terminal."""
    report(Console(width=150))


def report(console: Console) -> None:
    """Print a line for each kind of problem and each limit."""
    table = Table(title="The lattice within limits of time", box=SIMPLE_HEAD, title_justify="left")
    for heading in (
        "problems",
        "vehicle",
        "limit ms",
        "median ms",
        "90 % ms",
        "worst ms",
        "solved",
        "drives s",
    ):
        table.add_column(heading, justify="right")
    for name, vehicle, count, limits in ASKED:
        ways = (None, *limits)
        attempts = _attempts([_problem(name, vehicle, i) for i in range(count)], vehicle, ways)
        both = [all(attempts[i, way].solved for way in range(len(ways))) for i in range(count)]
        for way, limit in enumerate(ways):
            made = [attempts[i, way] for i in range(count)]
            took = 1e3 * np.array([attempt.planning_seconds for attempt in made])
            drives = [
                attempt.duration_s or 0.0 for attempt, is_both in zip(made, both, strict=True) if is_both
            ]
            table.add_row(
                *(name, vehicle, "none" if limit is None else f"{1e3 * limit:g}"),
                *(f"{value:.1f}" for value in (np.median(took), np.quantile(took, 0.9), took.max())),
                f"{sum(attempt.solved for attempt in made)} of {count}",
                f"{np.mean(drives):.2f}" if drives else "-",
            )
    console.print(table)


def _problem(name: str, vehicle: str, index: int) -> Problem:
    if name == "trap":
        return problem_class(name).draw(SEED, index)
    return to_canonical(family(name, "standard", VEHICLES[vehicle]).draw(SEED, index))[0]


def _attempts(
    problems: list[Problem], vehicle: str, ways: tuple[float | None, ...]
) -> dict[tuple[int, int], Attempt]:
    driven, workspace = VEHICLES[vehicle], Workspace()

    def attempt(problem: Problem, way: int) -> Attempt:
        limits, seconds = usual_limits(problem), ways[way]
        within = limits if seconds is None else replace(limits, seconds=seconds)
        return solve(problem, "lattice", limits=within, vehicle=driven, workspace=workspace)

    for way in range(len(ways)):  # anything compiled or made on first use exists before time counts
        attempt(problems[0], way)
    return in_turn(problems, len(ways), SEED, attempt)


if __name__ == "__main__":
    main()
