"""The vehicles beside the car: do the planners solve for them too, how fast, and is every plan lawful?

``python -m tests.speed.vehicles`` prints, per vehicle, class at ``easy`` and planner: solved share, times of
planning from scratch, and how many plans the authority refused; then each vehicle's best planner. With a
folder it draws ``vehicles.png`` there: how each of the four solves one problem.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from dashboards.figures.pictures import Example, gallery
from planners.search.outcome import Outcome
from planners.search.registry import PLANNERS, plan
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from planners.world.workspace import Workspace
from storage.places.files import whole_file
from tests.speed.planners import SEED, measure
from tests.speed.statistics import with_interval

COUNT = 200  # problems a class
PICTURED, PICTURED_PLANNER = 2, "follow"
WORKSPACE = Workspace()  # for every attempt: all are made in one thread
OTHERS = {name: vehicle for name, vehicle in VEHICLES.items() if vehicle != CAR}

Rows = list[tuple[Outcome, float]]  # of each problem: what came out, and seconds


def refused(problems: list[Problem], rows: Rows, vehicle: Vehicle) -> list[str]:
    """The first fault of each plan that the authority refuses."""
    found = [
        faults(p, o.plan, vehicle) for p, (o, _) in zip(problems, rows, strict=True) if o.plan is not None
    ]
    return [wrong[0] for wrong in found if wrong]


def solved_share(rows: Rows) -> float:
    """Share of the problems for which a plan was found."""
    return float(np.mean([outcome.plan is not None for outcome, _ in rows]))


def add_rows(table: Table, place: tuple[str, str], rows: dict[str, Rows], wrong: dict[str, int]) -> None:
    """One row a planner."""
    for planner, found in rows.items():
        seconds = [second for _, second in found]
        plans = [outcome.plan for outcome, _ in found if outcome.plan is not None]
        table.add_row(
            *place,
            planner,
            f"{solved_share(found):.1%}",
            with_interval(1e3 * np.array(seconds), ".2f"),
            f"{1e3 * np.mean(seconds):.2f}",
            f"{1e3 * np.quantile(seconds, 0.9):.2f}",
            f"{np.mean([found.duration_s for found in plans]):.1f}" if plans else "-",
            str(wrong[planner]),
        )


def report(console: Console, count: int = COUNT) -> None:
    """Print the table and the verdict; AssertionError where the authority refused a plan."""
    title = f"Vehicles: {count} problems a class at easy, from scratch"
    table = Table(title=title, title_justify="left")
    for name in ("vehicle", "class", "planner"):
        table.add_column(name)
    for name in ("solved", "median ms [95 %]", "mean ms", "90 % ms", "driving s", "refused"):
        table.add_column(name, justify="right")
    lines, reasons = [], []
    for name, vehicle in OTHERS.items():
        found: dict[str, Rows] = {planner: [] for planner in PLANNERS}
        for class_name in CLASSES:
            drawn = problem_class(class_name, "easy", vehicle)
            problems = [drawn.draw(SEED, index) for index in range(count)]
            rows = measure({planner: partial(_plan, planner, vehicle) for planner in PLANNERS}, problems)
            wrong = {planner: refused(problems, rows[planner], vehicle) for planner in PLANNERS}
            add_rows(
                table, (name, class_name), rows, {planner: len(faults) for planner, faults in wrong.items()}
            )
            for planner in PLANNERS:
                found[planner] += rows[planner]
                reasons += wrong[planner]
        table.add_section()
        best = max(found, key=lambda planner: (solved_share(found[planner]), -_mean_seconds(found[planner])))
        share, seconds = solved_share(found[best]), _mean_seconds(found[best])
        lines.append(f"{name}: best is {best}, {share:.2%} solved in a mean of {1e3 * seconds:.2f} ms")
    console.print(table)
    for line in lines:
        console.print(line)
    assert not reasons, f"The authority refused {len(reasons)} plans; the first: {reasons[0]}"


def _plan(planner: str, vehicle: Vehicle, problem: Problem, rng: np.random.Generator) -> Outcome:
    return plan(planner, problem, rng, vehicle=vehicle, workspace=WORKSPACE)


def _mean_seconds(rows: Rows) -> float:
    return float(np.mean([seconds for _, seconds in rows]))


def draw(folder: Path) -> None:
    """One problem solved by every vehicle with the best planner."""
    examples = []
    for name, vehicle in VEHICLES.items():
        problem = problem_class("trap", "standard", vehicle).draw(SEED, PICTURED)
        found = _plan(PICTURED_PLANNER, vehicle, problem, generator(SEED, problem.id)).plan
        told = "no plan" if found is None else f"{found.length_m:.0f} m in {found.duration_s:.0f} s"
        examples.append(Example(problem, (), found, f"{name}: {told}", vehicle))
    figure = gallery(examples, "Four vehicles, one problem, from scratch")
    with whole_file(folder / "vehicles.png") as temporary:
        figure.savefig(temporary, format="png", dpi=130, metadata={"Software": None})


if __name__ == "__main__":
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]))
    else:
        report(Console(width=120))
