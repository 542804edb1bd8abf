"""How fast the planners answer general questions, from scratch or with a library of plans, cold, on one core.

``python -m tests.speed.general_questions [--questions 200] [--poses] [--vehicle car] [--planners lattice …]
[--memory LIBRARY] [--keep FILE] [--unpolished | --both]``
draws questions in the classes and, where they lie beside the repository, in windows of four city maps: start
and goal over the free space, speeds from 0 to the largest, 2 to 70 m apart. It prints for each world and
planner the solved share, of all and of what any planner solves, planning times and driving times. With a
library (``motion-memory gather``) the lattice also recalls from it, and blindly; GUST has a fresh guide.
Plans are polished; ``--unpolished`` takes them as they are found, ``--both`` both ways.
With ``--keep`` each question is written down as soon as it is answered, and the same command goes on there.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

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
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.vehicles.vehicle_files import said_vehicle
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.worlds import SHARED

SEED: Final = 78
CITIES: Final = ("Berlin_0_256", "Denver_1_256", "Moscow_1_256", "NewYork_0_256")
WITH_MEMORY: Final = [("lattice", "closed"), ("lattice", "random-closed"), ("gust", "fresh")]
WORLDS: Final = (*CLASSES, *(CITIES if SHARED.is_dir() else ()))


def worlds_of(name: str, count: int, vehicle: Vehicle, seed: int = SEED) -> list[Problem]:
    """So many worlds of a class, or windows of a city."""
    if name in CLASSES:
        source = problem_class(name, vehicle=vehicle)
        return [source.draw(seed, index) for index in range(count)]
    city = source_at(SHARED / "maps" / f"{name}.map")
    size = vehicle.scale  # a city for a vehicle half as large is half as large
    settings = ImportSettings(vehicle, count=count, seed=seed, scale=size, resolution=size)
    return list(import_part(city, "test", settings).problems)


def questions_of(name: str, count: int, vehicle: Vehicle, pose: bool, seed: int = SEED) -> Iterator[Problem]:
    """One question in each of ``count`` worlds, fewer if some have no room."""
    for number, world in enumerate(worlds_of(name, count, vehicle, seed)):
        asked = question_in(world, number, seed, vehicle, pose)
        if asked is not None:
            yield to_canonical(asked)[0]


class Way(NamedTuple):
    """A way to answer a question."""

    planner: str
    assist: str
    polished: bool


class Answer(NamedTuple):
    """What came of one attempt."""

    solved: bool
    recalled: bool
    seconds: float  # of planning
    driving_s: float
    faults: int  # that the authority found


Rows = dict[str, list[Answer]]  # for each question, those of all planners and assists


def read_kept(kept: Path | None, settings: str) -> Rows:
    """Read what was answered before; its first line are the settings, which have to be the same."""
    if kept is None or not kept.exists():
        if kept is not None:
            kept.write_text(settings + "\n")
        return {}
    first, *lines = kept.read_text().split("\n")
    if first != settings:
        raise SystemExit(f"{kept} is of other settings, {first}: give another file")
    rows = [json.loads(line) for line in lines[:-1]]  # the last line is empty or was cut off
    kept.write_text("\n".join((first, *lines[:-1], "")))
    return {name: [Answer(*answer) for answer in answers] for name, answers in rows}


def measured(
    questions: list[Problem],
    ways: list[Way],
    vehicle: Vehicle,
    library: PlanLibrary | None,
    done: Rows,
    kept: Path | None,
) -> list[list[Answer]]:
    """Answers by question, then way, cold: other data fill the caches before each attempt."""
    workspace, other_work = Workspace(), OtherWork()

    def attempt(way: Way, question: Problem, seed: int) -> Attempt:
        return solve(
            *(question, way.planner, way.assist, 1, library, seed),
            vehicle=vehicle,
            workspace=workspace,
            polished=way.polished,
        )

    for way in ways:
        for question in questions[:5]:
            attempt(way, question, SEED + 1)  # compiles
    with no_garbage_collection():
        for number, question in enumerate(questions):
            if question.id in done:
                continue
            at = number % len(ways)
            attempts: dict[Way, Attempt] = {}
            for way in ways[at:] + ways[:at]:
                other_work()
                attempts[way] = attempt(way, question, SEED)
            done[question.id] = [
                Answer(
                    *(each.solved, each.source == "recalled", each.planning_seconds, each.duration_s or 0.0),
                    0 if each.plan is None else len(faults(question, each.plan, vehicle)),
                )
                for each in (attempts[way] for way in ways)
            ]
            if kept is not None:
                with kept.open("a") as file:
                    file.write(json.dumps([question.id, done[question.id]]) + "\n")
    return [done[question.id] for question in questions]


def report(console: Console, asked: argparse.Namespace) -> None:
    """Measure and print."""
    vehicle = said_vehicle(asked.vehicle)
    kind = "poses" if asked.poses else "discs"
    table = Table(title=f"General questions, {asked.vehicle}, {kind}", title_justify="left")
    pairs = [(planner, "none") for planner in asked.planners]
    pairs += [] if asked.memory is None else WITH_MEMORY
    both = [False, True] if asked.both else [not asked.unpolished]
    ways = [Way(*pair, polished) for pair in pairs for polished in both]
    library = None if asked.memory is None else load_library(asked.memory, vehicle)
    for column in ("world", "questions", "planner", "assist", "plan"):
        table.add_column(column)
    for column in ("solved", "of any", "recalled", "median ms", "mean", "99 %", "driving s", "faulty"):
        table.add_column(column, justify="right")
    settings = json.dumps([asked.vehicle, kind, ways, str(asked.memory), SEED])
    done = read_kept(asked.keep, settings)
    for name in asked.worlds:
        questions = list(questions_of(name, asked.questions, vehicle, asked.poses))
        rows = measured(questions, ways, vehicle, library, done, asked.keep)
        solved = np.array([[answer.solved for answer in row] for row in rows])
        anyone, everyone = solved.any(axis=1), solved.all(axis=1)
        for k, way in enumerate(ways):
            answers = [row[k] for row in rows]
            ms = 1e3 * np.array([answer.seconds for answer in answers])[anyone]
            driving = np.array([answer.driving_s for answer in answers])[everyone]
            table.add_row(
                *(name, str(len(questions)), way.planner, way.assist),
                "polished" if way.polished else "as found",
                *(f"{solved[:, k].mean():.1%}", f"{solved[anyone, k].mean():.1%}"),
                f"{np.mean([answer.recalled for answer in answers]):.1%}",
                *(f"{np.median(ms):.2f}", f"{ms.mean():.2f}", f"{np.quantile(ms, 0.99):.1f}"),
                *(f"{driving.mean():.2f}" if len(driving) else "-",),
                str(sum(answer.faults > 0 for answer in answers)),
            )
            if asked.failures:
                failed = [
                    q.id for q, any_, own in zip(questions, anyone, solved[:, k], strict=True) if any_ > own
                ]
                console.print(name, way, failed[:20])
        table.add_section()
    console.print(table)


def main() -> None:
    """Read the options and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--questions", type=int, default=200, help="a world")
    parser.add_argument("--poses", action="store_true", help="goal poses at rest instead of discs")
    parser.add_argument("--vehicle", default="car", help="its name, or its .yaml file")
    parser.add_argument("--planners", nargs="+", choices=PLANNERS, default=list(PLANNERS))
    parser.add_argument("--memory", type=Path, help="a library")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--unpolished", action="store_true", help="plans as they are found")
    how.add_argument("--both", action="store_true", help="plans as they are found, and polished ones")
    parser.add_argument("--keep", type=Path, help="a file of the answers so far, from which to go on")
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--failures", action="store_true", help="name questions that only others solve")
    report(Console(width=120), parser.parse_args())


if __name__ == "__main__":
    main()
