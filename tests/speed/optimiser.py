"""The compiled optimiser beside IPOPT: driving time before and after, time, share that ends in a plan.

``python -m tests.speed optimiser`` prints a line a vehicle; ``python -m tests.speed.optimiser N`` takes N
problems a vehicle, a third of each class, instead of 60. Both begin with the same plan of GUST.
"""

from __future__ import annotations

import sys
from time import perf_counter
from typing import NamedTuple

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from planners.optimisation.optimise import optimise
from planners.optimisation.polish import polish
from planners.search.registry import plan
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


class Tried(NamedTuple):
    """One problem; driving times in seconds, NaN where there is no plan."""

    before: float
    polished: float
    iterations: int
    milliseconds: float
    by_ipopt: float
    ipopt_seconds: float
    faults: int


def try_one(name: str, index: int, vehicle: Vehicle, workspace: Workspace) -> Tried | None:
    """Optimise the plan of one problem twice; None if GUST finds none."""
    problem = problem_class(name, vehicle=vehicle).draw(SEED, index)
    scene = scene_of(problem)
    found = plan("gust", problem, generator(SEED, problem.id), vehicle=vehicle, workspace=workspace).plan
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


def table(count: int) -> Table:
    """A line a vehicle: means with 95 % intervals."""
    result = Table(box=SIMPLE_HEAD)
    for heading in (
        "vehicle", "problems", "before s", "polished s", "IPOPT s", "ratio", "plans: polished, IPOPT",
        "iterations", "ms: median, 90 %", "IPOPT ms", "faults",
    ):  # fmt: skip
        result.add_column(heading, justify="left" if heading == "vehicle" else "right", no_wrap=True)
    for label, vehicle in VEHICLES.items():
        workspace = Workspace()
        try_one(CLASSES[0], count, vehicle, workspace)  # compiled now
        asked = [(name, index) for name in CLASSES for index in range(-(-count // len(CLASSES)))]
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
    """Print the table for some problems of each vehicle."""
    console.print(table(COUNT))


if __name__ == "__main__":
    Console(width=190).print(table(int(sys.argv[1]) if len(sys.argv) > 1 else COUNT))
