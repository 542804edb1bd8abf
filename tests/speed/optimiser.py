"""The compiled optimiser beside IPOPT: driving time before and after, time, share that ends in a plan.

``python -m tests.speed optimiser`` prints a line for each kind of goal and vehicle;
``python -m tests.speed.optimiser [N] [--goals place pose] [--vehicles car …]`` takes N problems a line, a
third of each class, instead of 60. Both begin with the same plan: of GUST for canonical problems, whose goal
is a place, of the lattice for general questions, whose goal is a pose.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from planners.maps.questions import question_in
from planners.optimisation.optimise import optimise
from planners.optimisation.polish import polish
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from planners.world.workspace import Workspace
from tests.speed.statistics import with_interval

SEED = 93
COUNT = 60
PLANNER = {"place": "gust", "pose": "lattice"}
LIMITS = Limits(expansions=20_000)


class Tried(NamedTuple):
    """One problem; driving times in seconds, NaN where there is no plan."""

    before: float
    polished: float
    iterations: int
    milliseconds: float
    by_ipopt: float
    ipopt_seconds: float
    faults: int


def try_one(goal: str, name: str, index: int, vehicle: Vehicle, workspace: Workspace) -> Tried | None:
    """Optimise the plan of one problem twice; None if none is found."""
    problem = problem_class(name, vehicle=vehicle).draw(SEED, index)
    if goal == "pose":
        asked = question_in(problem, index, SEED, vehicle, pose=True)
        if asked is None:
            return None
        problem, _ = to_canonical(asked)
    scene = scene_of(problem)
    rng = generator(SEED, problem.id)
    found = plan(PLANNER[goal], problem, rng, vehicle=vehicle, workspace=workspace, limits=LIMITS).plan
    if found is None:
        return None
    began = perf_counter()
    polished = polish(problem, found, vehicle, scene, workspace)
    seconds = perf_counter() - began
    exact = optimise(problem, found, vehicle=vehicle)
    wrong = 0 if polished.plan is None else len(faults(problem, polished.plan, vehicle))
    return Tried(
        found.duration_s,
        _duration(polished.plan),
        polished.iterations,
        1000.0 * seconds,
        _duration(exact.plan),
        exact.seconds,
        wrong,
    )


def _duration(found: Plan | None) -> float:
    return float("nan") if found is None else found.duration_s


def table(count: int, goals: Sequence[str], vehicles: Sequence[str]) -> Table:
    """A line for each kind of goal and vehicle: means with 95 % intervals."""
    result = Table(box=SIMPLE_HEAD)
    for heading in (
        "goal, vehicle", "problems", "before s", "polished s", "IPOPT s", "ratio", "plans: polished, IPOPT",
        "iterations", "ms: median, 90 %", "IPOPT ms", "faults",
    ):  # fmt: skip
        result.add_column(heading, justify="left" if heading == "goal, vehicle" else "right")
    for goal, name in itertools.product(goals, vehicles):
        label, vehicle, workspace = f"{goal}, {name}", VEHICLES[name], Workspace()
        try_one(goal, CLASSES[0], count, vehicle, workspace)  # compiled now
        asked = [(goal, each, index) for each in CLASSES for index in range(-(-count // len(CLASSES)))]
        tried = [
            try_one(*each, vehicle, workspace) for each in track(asked, description=label, transient=True)
        ]
        before, ours, iterations, took, theirs, seconds, wrong = np.array(
            [each for each in tried if each is not None]
        ).T
        both = np.isfinite(ours) & np.isfinite(theirs)
        result.add_row(
            label,
            str(len(before)),
            with_interval(before, ".2f", np.mean),
            with_interval(ours, ".2f", np.mean),
            with_interval(theirs[both], ".2f", np.mean),
            with_interval((ours / theirs)[both], ".4f", np.mean),
            f"{np.isfinite(ours).mean():.3f}, {np.isfinite(theirs).mean():.3f}",
            f"{iterations.mean():.0f}",
            f"{np.median(took):.1f}, {np.quantile(took, 0.9):.1f}",
            f"{1000.0 * np.median(seconds):.0f}",
            f"{wrong.sum():.0f}",
        )
    return result


def report(console: Console) -> None:
    """Print the table for some problems of each kind of goal and vehicle."""
    console.print(table(COUNT, list(PLANNER), list(VEHICLES)))


def main() -> None:
    """Read the options and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=COUNT, help="problems a line")
    parser.add_argument("--goals", nargs="+", choices=PLANNER, default=list(PLANNER))
    parser.add_argument("--vehicles", nargs="+", choices=VEHICLES, default=list(VEHICLES))
    asked = parser.parse_args()
    Console(width=190).print(table(asked.count, asked.goals, asked.vehicles))


if __name__ == "__main__":
    main()
