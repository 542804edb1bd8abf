"""What it changes that driving backwards or changing gear costs a vehicle more than its time.

``python -m tests.speed driving_costs [--questions 40] [--vehicles docs/vehicles/hunter.yaml …]`` asks the
same questions for poses (in the three classes) and the same hard parking problems of each vehicle, without
costs and with some. It prints planning and driving times, of driving those backwards, and changes of gear, by
mean over what is solved with all of them. The authority judges every plan.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import CLASSES
from planners.world.driving_cost import cost_of, cusps_of, gears_of
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Costs, Vehicle
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle
from tests.speed.general_questions import questions_of
from tests.speed.manoeuvre_attempts import SEED

VEHICLES: Final = ("docs/vehicles/hunter.yaml", "docs/vehicles/jackal.yaml", "car")
PARKING: Final = ("parallel", "perpendicular", "lot")
ASKED: Final = (
    Costs(),
    Costs(backwards=1.2),
    Costs(backwards=2.0),
    Costs(gear_change=1.0),
    Costs(1.0, 1.0, 2.0),
)


class Driven(NamedTuple):
    """What came of one attempt."""

    planning_s: float
    driving_s: float
    backwards_s: float
    gear_changes: int
    cost_s: float


def _problems(vehicle: Vehicle, count: int) -> Iterator[tuple[str, list[Problem]]]:
    yield "poses", [each for name in CLASSES for each in questions_of(name, count, vehicle, True)]
    drawn = [family(name, "hard", vehicle) for name in PARKING]
    yield "hard parking", [to_canonical(each.draw(SEED, i))[0] for each in drawn for i in range(count)]


def _driven(problem: Problem, vehicle: Vehicle, workspace: Workspace) -> Driven | None:
    """One attempt; None if there is no plan. Raises AssertionError for one that the authority refuses."""
    attempt = solve(problem, "lattice", vehicle=vehicle, workspace=workspace)
    plan = attempt.plan
    if plan is None:
        return None
    found = faults(problem, plan, vehicle)
    assert not found, found
    backwards = float((gears_of(plan, vehicle) < 0).sum() * plan.dt)
    changes = len(cusps_of(plan, vehicle))
    return Driven(attempt.planning_seconds, plan.duration_s, backwards, changes, cost_of(plan, vehicle))


def report(console: Console, vehicles: tuple[str, ...] = VEHICLES, count: int = 40) -> None:
    """Print a table."""
    table = Table(title="What driving backwards and changing gear cost", title_justify="left")
    for column in (
        "vehicle",
        "asked",
        "costs",
        "solved",
        "ms",
        "driving s",
        "backwards s",
        "changes",
        "cost s",
    ):
        table.add_column(column, justify="left" if column in ("vehicle", "asked", "costs") else "right")
    workspace = Workspace()
    for name in vehicles:
        vehicle = said_vehicle(name)
        for asked, problems in _problems(vehicle, count):
            rows = []
            for costs in ASKED:
                paying = vehicle._replace(costs=costs)
                _driven(problems[0], paying, workspace)
                rows.append([_driven(each, paying, workspace) for each in problems])
            common = [i for i in range(len(problems)) if all(row[i] is not None for row in rows)]
            for costs, row in zip(ASKED, rows, strict=True):
                means = np.mean([each for i in common if (each := row[i]) is not None], axis=0)
                solved = sum(each is not None for each in row)
                said = ", ".join(f"{key} {value:g}" for key, value in costs._asdict().items()
                                 if value != getattr(Costs(), key))  # fmt: skip
                figures = f"{1e3 * means[0]:.0f}", *(f"{mean:.2f}" for mean in means[1:])
                label = vehicle.about.name.decode()
                table.add_row(label, asked, said or "none", f"{solved} of {len(problems)}", *figures)
    console.print(table)


def main(arguments: list[str]) -> None:
    """Print a table for other vehicles, or with more questions of each kind."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed driving_costs")
    parser.add_argument("--questions", type=int, default=40)
    parser.add_argument("--vehicles", nargs="+", default=VEHICLES)
    asked = parser.parse_args(arguments)
    report(Console(width=170), tuple(asked.vehicles), asked.questions)
