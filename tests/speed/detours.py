"""What a free stored plan is worth beside the one that a planner finds, and when it is a detour.

``python -m tests.speed.detours [--candidates 1000] [--problems 1000] [--only NAME …]`` collects candidates of
each class as a run does and keeps 100, of one variant and of all that compete. It prints, for new problems,
the share in which a plan is free, and how much driving time a memory saves the lattice and GUST; the latter
for several shares by which a detour takes longer than the way over the grid, and how many of the free plans
are searched anew. Intervals are of 95 %. Planning time is not counted.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Final
from unittest import mock

import numpy as np
from rich.console import Console

from planners.memory.curation import curate
from planners.memory.memory import Memory
from planners.memory.plans.experience import Experience
from planners.search.guides import detour
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, ProblemClass, problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from tasks.settings.presets import for_preset
from tasks.stages.collect import VARIANTS, candidates_of
from tests.planners.memories import memory_of_plans
from tests.speed.statistics import with_interval

COLLECTING, MEASURING = 301, 303  # seeds
KEPT: Final = 100
LONGER: Final = (np.inf, 1.1, 1.08, 1.05, 1.03, 1.02, 0.0)  # than the way over the grid at full speed
NAMES: Final = [f"{name}-{difficulty}" for difficulty in ("standard", "hard") for name in CLASSES]


def collected(source: ProblemClass, count: int) -> list[list[Experience]]:
    """The candidates of so many problems, those of each problem together."""
    settings, workspace = for_preset("laptop", candidates=KEPT + 1), Workspace()
    found: list[list[Experience]] = []
    index = 0
    while len(found) < count:
        made = candidates_of(source.draw(COLLECTING, index), VARIANTS, settings, CAR, workspace)
        found += [[each.experience for each in made]] if made else []
        index += 1
    return found


def report(console: Console, name: str, candidates: int, problems: list[Problem]) -> None:
    """Print the lines of a class."""
    class_name, difficulty = name.split("-")
    found = collected(problem_class(class_name, difficulty), candidates)
    workspace = Workspace()

    def driving(planner: str, memory: Memory | None = None) -> tuple[Floats, Floats]:
        assist = "none" if memory is None else "closed"
        first = partial(solve, workspace=workspace, polished=False)
        made = [first(problem, planner, assist, 5, memory) for problem in problems]
        return (
            np.array([np.nan if each.duration_s is None else each.duration_s for each in made]),
            np.array([each.source == "recalled" for each in made], float),
        )

    alone = {planner: driving(planner)[0] for planner in ("lattice", "gust")}
    for variants in (1, 3):
        competing = [each for some in found for each in some[:variants]]
        kept = [competing[i].plan for i in curate(competing, KEPT)]
        memory = memory_of_plans(kept, np.zeros(KEPT + 1))
        with_memory, free = driving("gust", memory)
        saved = alone["gust"] - with_memory
        console.print(
            f"{name}, {variants} competing: a plan is free in {with_interval(100 * free, '.1f', np.mean)} %; "
            f"GUST saves {with_interval(saved[np.isfinite(saved)], '.2f', np.mean)} s"
        )
        for longer in LONGER:
            with mock.patch.dict(detour.DETOURS, {"lattice": longer}):
                with_memory, handed = driving("lattice", memory)
            saved = alone["lattice"] - with_memory
            shown = with_interval(saved[np.isfinite(saved)], ".3f", np.mean)
            console.print(
                f"  lattice, detours from {longer:.2f} on: saves {shown} s, "
                f"hands out a stored plan in {100 * handed.mean():.1f} %"
            )


def main() -> None:
    """Print all that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--candidates", type=int, default=1_000)
    parser.add_argument("--problems", type=int, default=1_000)
    parser.add_argument("--only", nargs="+", default=NAMES, choices=NAMES)
    asked = parser.parse_args()
    for name in asked.only:
        source = problem_class(*name.split("-"))
        drawn = [source.draw(MEASURING, index) for index in range(asked.problems)]
        report(Console(width=130, highlight=False), name, asked.candidates, drawn)


if __name__ == "__main__":
    main()
