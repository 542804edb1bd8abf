"""How fast the planners are from scratch, on one core.

``python -m tests.speed.planners`` prints, per class at ``standard`` and per planner: solved share, median and
mean milliseconds, collision checks a second; and the sweep over roadmap sizes that GUST's and Follow's
defaults come from. Problems have a seed of their own: they are neither collected from nor tested on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from planners.search.follow import FollowSettings, follow
from planners.search.gust import GustSettings, gust
from planners.search.outcome import Outcome, Status
from planners.search.query import Query
from planners.search.registry import PLANNERS, plan
from planners.search.structures.roadmap import RoadmapSettings
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from tests.speed.statistics import with_interval

SEED = 77  # the tuning seed
COUNT = 200  # problems a class
BATCHES = (40, 60, 100, 150, 200, 300, 500)  # nodes drawn before the first search for a way
NEIGHBOURS = (8, 12)
WORKSPACE = Workspace()  # for every attempt: all are made in one thread

Run = Callable[[Problem, np.random.Generator], Outcome]


def measure(runs: dict[str, Run], problems: list[Problem]) -> dict[str, list[tuple[Outcome, float]]]:
    """Outcomes and seconds of every run on every problem, the runs of one problem next to each other."""
    rows: dict[str, list[tuple[Outcome, float]]] = {name: [] for name in runs}
    for run in runs.values():
        run(problems[0], generator(SEED))  # compiled or loaded now, not while the clock runs
    for number, problem in enumerate(track(problems, description=problems[0].class_name, transient=True)):
        names = list(runs)
        for name in names[number % len(names) :] + names[: number % len(names)]:
            rng = generator(SEED, problem.id)
            began = perf_counter()
            outcome = runs[name](problem, rng)
            rows[name].append((outcome, perf_counter() - began))
    return rows


def cells(rows: list[tuple[Outcome, float]]) -> list[str]:
    """Solved share; median, mean, 90 % ms; roadmap median ms; checks a problem; million checks a second."""
    seconds = np.array([second for _, second in rows])
    checks = np.array([outcome.collision_checks for outcome, _ in rows])
    return [
        f"{np.mean([outcome.status is Status.SOLVED for outcome, _ in rows]):.1%}",
        with_interval(1e3 * seconds, ".2f"),
        f"{1e3 * seconds.mean():.2f}",
        f"{1e3 * np.quantile(seconds, 0.9):.2f}",
        f"{1e3 * np.median([outcome.roadmap_seconds for outcome, _ in rows]):.2f}",
        f"{checks.mean():,.0f}",
        f"{checks.sum() / seconds.sum() / 1e6:.2f}",
    ]


def table(title: str, first: str) -> Table:
    """An empty table with the columns of ``cells``."""
    result = Table(title=title, title_justify="left")
    for name in ("class", first):
        result.add_column(name)
    for name in ("solved", "median ms [95 %]", "mean ms", "90 % ms", "roadmap ms", "checks", "M checks/s"):
        result.add_column(name, justify="right")
    return result


def sized(roadmap: RoadmapSettings) -> dict[str, Run]:
    """GUST and Follow with another roadmap."""
    plain = GustSettings(roadmap=roadmap)
    clear = GustSettings(roadmap=roadmap._replace(clearance_exponent=1.0))
    return {
        "gust": partial(_call, gust, plain),
        "follow": partial(_call, follow, FollowSettings(gust=clear)),
    }


def _call(
    planner: Callable[..., Outcome], settings: object, problem: Problem, rng: np.random.Generator
) -> Outcome:
    return planner(Query(problem, rng, scene_of(problem), WORKSPACE), settings)


def _default(name: str, problem: Problem, rng: np.random.Generator) -> Outcome:
    return plan(name, problem, rng, workspace=WORKSPACE)


def report(console: Console) -> None:
    """Print both tables."""
    totals: dict[str, list[float]] = {}  # mean milliseconds of a roadmap size, class by class
    speeds = table(f"From scratch, defaults, {COUNT} problems a class", "planner")
    sweep = table("Roadmap size: nodes drawn at first / neighbours", "planner")
    for name in CLASSES:
        problems = [problem_class(name).draw(SEED, index) for index in range(COUNT)]
        rows = measure({planner: partial(_default, planner) for planner in PLANNERS}, problems)
        for planner in PLANNERS:
            speeds.add_row(name, planner, *cells(rows[planner]))
        speeds.add_section()
        runs = {
            f"{planner} {batch} / {neighbours}": run
            for neighbours in NEIGHBOURS
            for batch in BATCHES
            for planner, run in sized(RoadmapSettings(batch=batch, neighbours=neighbours)).items()
        }
        rows = measure(runs, problems)
        for planner in ("gust", "follow"):
            for key in (key for key in runs if key.startswith(planner)):
                sweep.add_row(name, key, *cells(rows[key]))
                solved = all(outcome.status is Status.SOLVED for outcome, _ in rows[key])
                mean_ms = 1e3 * float(np.mean([second for _, second in rows[key]]))
                totals.setdefault(key, []).append(mean_ms if solved else math.inf)
            sweep.add_section()
    console.print(speeds)
    console.print(sweep)
    for planner in ("gust", "follow"):
        best = min((key for key in totals if key.startswith(planner)), key=lambda key: sum(totals[key]))
        console.print(f"Best at full success, by the mean over the classes: {best}")


if __name__ == "__main__":
    report(Console(width=110))
