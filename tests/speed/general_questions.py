"""How fast the planners answer general questions, from scratch or with a library of plans, cold, on one core.

``python -m tests.speed.general_questions [--questions 200] [--poses] [--vehicle car] [--planners lattice …]
[--memory LIBRARY]``
draws questions in the classes and, where they lie beside the repository, in windows of four city maps: start
and goal over the free space, speeds from 0 to the largest, 2 to 70 m apart. It prints for each world and
planner the solved share, of all and of what any planner solves, planning times and driving times. With a
library (``motion-memory gather``) the lattice also recalls from it, and blindly; GUST has a fresh guide.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.attempt import Attempt
from planners.maps.questions import question_in
from planners.memory.library.plan_library import PlanLibrary
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.worlds import SHARED

SEED: Final = 78
CITIES: Final = ("Berlin_0_256", "Denver_1_256", "Moscow_1_256", "NewYork_0_256")
WITH_MEMORY: Final = [("lattice", "closed"), ("lattice", "random-closed"), ("gust", "fresh")]
WORLDS: Final = (*CLASSES, *(CITIES if SHARED.is_dir() else ()))


def worlds_of(name: str, count: int, vehicle: Vehicle) -> list[Problem]:
    """So many worlds of a class, or windows of a city."""
    if name in CLASSES:
        source = problem_class(name, vehicle=vehicle)
        return [source.draw(SEED, index) for index in range(count)]
    city = source_at(SHARED / "maps" / f"{name}.map")
    return list(import_part(city, "test", ImportSettings(count=count, seed=SEED, vehicle=vehicle)).problems)


def questions_of(name: str, count: int, vehicle: Vehicle, pose: bool) -> Iterator[Problem]:
    """One question in each of ``count`` worlds, fewer if some have no room."""
    for number, world in enumerate(worlds_of(name, count, vehicle)):
        asked = question_in(world, number, SEED, vehicle, pose)
        if asked is not None:
            yield to_canonical(asked)[0]


def measured(
    questions: list[Problem], ways: list[tuple[str, str]], vehicle: Vehicle, library: PlanLibrary | None
) -> dict[tuple[str, str], list[Attempt]]:
    """Attempts by planner and assist, cold: other data fill the caches before each."""
    workspace, other_work = Workspace(), OtherWork()

    def attempt(way: tuple[str, str], question: Problem, seed: int) -> Attempt:
        return solve(question, *way, 1, library, seed, vehicle=vehicle, workspace=workspace)

    rows: dict[tuple[str, str], list[Attempt]] = {way: [] for way in ways}
    for way in ways:
        for question in questions[:5]:
            attempt(way, question, SEED + 1)  # compiles
    with no_garbage_collection():
        for number, question in enumerate(questions):
            at = number % len(ways)
            for way in ways[at:] + ways[:at]:
                other_work()
                rows[way].append(attempt(way, question, SEED))
    return rows


def report(console: Console, asked: argparse.Namespace) -> None:
    """Measure and print."""
    vehicle = VEHICLES[asked.vehicle]
    kind = "poses" if asked.poses else "discs"
    table = Table(title=f"General questions, {asked.vehicle}, {kind}", title_justify="left")
    ways = [(planner, "none") for planner in asked.planners]
    ways += [] if asked.memory is None else WITH_MEMORY
    library = None if asked.memory is None else load_library(asked.memory, vehicle)
    for column in ("world", "questions", "planner", "assist"):
        table.add_column(column)
    for column in ("solved", "of any", "recalled", "median ms", "mean", "99 %", "driving s", "faulty"):
        table.add_column(column, justify="right")
    for name in asked.worlds:
        questions = list(questions_of(name, asked.questions, vehicle, asked.poses))
        rows = measured(questions, ways, vehicle, library)
        solved = {way: np.array([each.solved for each in rows[way]]) for way in ways}
        anyone = np.any(list(solved.values()), axis=0)
        everyone = np.all(list(solved.values()), axis=0)
        for way, attempts in rows.items():
            ms = 1e3 * np.array([each.planning_seconds for each in attempts])[anyone]
            driving = [each.duration_s for each, all_do in zip(attempts, everyone, strict=True) if all_do]
            faulty = sum(
                bool(faults(question, each.plan, vehicle))
                for question, each in zip(questions, attempts, strict=True)
                if each.plan is not None
            )
            table.add_row(
                *(name, str(len(questions)), *way),
                *(f"{solved[way].mean():.1%}", f"{solved[way][anyone].mean():.1%}"),
                f"{np.mean([each.source == 'recalled' for each in attempts]):.1%}",
                *(f"{np.median(ms):.2f}", f"{ms.mean():.2f}", f"{np.quantile(ms, 0.99):.1f}"),
                *(f"{np.mean(driving):.1f}" if driving else "-", str(faulty)),
            )
            if asked.failures:
                failed = [
                    q.id
                    for q, a, any_ in zip(questions, attempts, anyone, strict=True)
                    if any_ and not a.solved
                ]
                console.print(name, *way, failed[:20])
        table.add_section()
    console.print(table)


def main() -> None:
    """Read the options and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--questions", type=int, default=200, help="a world")
    parser.add_argument("--poses", action="store_true", help="goal poses at rest instead of discs")
    parser.add_argument("--vehicle", choices=VEHICLES, default="car")
    parser.add_argument("--planners", nargs="+", choices=PLANNERS, default=list(PLANNERS))
    parser.add_argument("--memory", type=Path, help="a library")
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--failures", action="store_true", help="name questions that only others solve")
    report(Console(width=120), parser.parse_args())


if __name__ == "__main__":
    main()
