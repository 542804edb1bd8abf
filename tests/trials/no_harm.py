"""Whether a memory does harm: planning with right and wrong memories against the same planner alone.

``python -m tests.trials.no_harm [--worlds FOLDER] [--problems 200] [--planners gust …] [--only NAME …]``
attempts new problems of each class at both difficulties, of two city maps, and of a folder of worlds that
nobody here drew, in turn and with cold caches: alone, and with memories of 100 polished plans each, of the
same problems, of other classes, and of another map. ``shuffled`` holds the right plans, but its encoder ranks
them by chance. A line gives mean and 99 % of planning time, and mean work, as multiples of the planner's
alone; intervals are of 95 %, problems resampled. The table at the end is of memories of other classes and of
another map: the mean of the one that costs most, then the most at 99 % and the most work of any.
``--processor-time`` counts the time of the processor and not of the clock, for a machine that is busy.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple
from unittest import mock

import numpy as np
from rich.console import Console

from planners.attempt import Attempt
from planners.memory.curation import curate
from planners.memory.memory import Memory
from planners.memory.plans.experience import Experience
from planners.optimisation.polish import polish
from planners.search.outcome import work_of
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import Part, source_at
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tasks.stages.collect import VARIANTS
from tests.planners.early_help import early_help
from tests.planners.memories import memory_of_plans

SEED: Final = 89
COLLECTED, PLANS, TOP_K = 400, 100, 5
RESAMPLES: Final = 1_000
DRAWN: Final = tuple(f"{name}-{difficulty}" for difficulty in ("standard", "hard") for name in CLASSES)
READ: Final = ("maps/Denver_1_256.map", "maps/Berlin_0_256.map", "grid201/forest")
WRONG: Final = ("curves-standard", "random-standard", "trap-hard", "maps/Denver_1_256.map")
ASSISTS: Final = ("closed", "open", "repair")
RANKED: Final = {"shuffled": "encoder"}  # the strategy of recall, where it is not the default


class Way(NamedTuple):
    """How problems are attempted."""

    assist: str
    memory: str


@functools.cache
def problems_of(world: str, part: Part, count: int, folder: Path) -> tuple[Problem, ...]:
    """At most ``count`` problems of a class or of a world of the folder."""
    if world in DRAWN:
        name, difficulty = world.split("-")
        drawn = problem_class(name, difficulty)
        return tuple(drawn.draw(2 * SEED + (part == "test"), index) for index in range(count))
    read = import_part(source_at(folder / world), part, ImportSettings(count=count)).problems
    return tuple(replace(to_canonical(problem)[0], class_name=Path(world).stem) for problem in read)


@functools.cache
def memory_of(world: str, folder: Path) -> Memory:
    """A memory of the lattice's polished plans, curated; it ranks by chance where an encoder is asked."""
    workspace, solved = Workspace(), []
    for problem in problems_of(world, "train", COLLECTED, folder):
        found = solve(problem, "lattice", seed=SEED, workspace=workspace, polished=False).plan
        if found is not None:
            scene = scene_of(problem)
            plan = polish(problem, found, CAR, scene, workspace, margin_m=VARIANTS[0].margin_m).plan
            solved.append(Experience(problem, plan or found))
    plans = [solved[i].plan for i in curate(solved, PLANS)]
    by_chance = np.concatenate(([-1.0], generator(SEED, world).random(len(plans))))
    return memory_of_plans(plans, by_chance)


def attempts_of(
    problems: Sequence[Problem], planner: str, ways: Sequence[Way], memories: dict[str, Memory]
) -> dict[Way, list[Attempt]]:
    """Attempt every problem in every way, none of them twice in a row, with other work in between."""
    workspace, other_work = Workspace(), OtherWork()

    def attempt(problem: Problem, way: Way) -> Attempt:
        strategy = RANKED.get(way.memory)
        asked = (problem, planner, way.assist, TOP_K, memories.get(way.memory), SEED)
        return solve(*asked, strategy=strategy, workspace=workspace, polished=False)

    for context in (early_help(), nullcontext()):  # so that what is rarely needed is compiled and loaded, too
        with context:
            for way in ways:
                for problem in problems[:5]:
                    attempt(problem, way)
    made: dict[tuple[int, Way], Attempt] = {}
    with no_garbage_collection():
        for turn in range(len(ways)):
            for number, problem in enumerate(problems):
                way = ways[(number + turn) % len(ways)]
                other_work()
                made[number, way] = attempt(problem, way)
    return {way: [made[number, way] for number in range(len(problems))] for way in ways}


def ratios(mine: Floats, alone: Floats) -> tuple[Floats, Floats]:
    """Mean and 99 % as multiples of the planner's alone, each with the ends of its interval."""
    drawn = np.random.default_rng(0).integers(len(mine), size=(RESAMPLES, len(mine)))
    mean = mine[drawn].mean(1) / alone[drawn].mean(1)
    tail = np.quantile(mine[drawn], 0.99, axis=1) / np.quantile(alone[drawn], 0.99, axis=1)
    at = (mine.mean() / alone.mean(), np.quantile(mine, 0.99) / np.quantile(alone, 0.99))
    both = [
        np.array([value, *np.quantile(each, [0.025, 0.975])])
        for value, each in zip(at, (mean, tail), strict=True)
    ]
    return both[0], both[1]


def report(console: Console, world: str, planner: str, made: dict[Way, list[Attempt]]) -> list[str]:
    """Print a line for each way, and return the cells of a table: the wrong memory that costs most."""
    times = {way: np.array([each.planning_seconds for each in rows]) for way, rows in made.items()}
    works = {
        way: np.array([work_of(each.collision_checks, each.expansions) for each in rows], float)
        for way, rows in made.items()
    }
    none = Way("none", "")
    alone = 1e3 * times[none]
    console.print(
        f"{world} {planner}: alone {alone.mean():.3f} ms, 99 % {np.quantile(alone, 0.99):.2f} ms, "
        f"work {works[none].mean():,.0f}",
    )
    wrong: dict[str, list[tuple[Floats, float, float]]] = {}
    for way, rows in made.items():
        if way == none:
            continue
        mean, tail = ratios(times[way], times[none])
        work = float(works[way].mean() / works[none].mean())
        if way.memory in WRONG:
            wrong.setdefault(way.assist, []).append((mean, tail[0], work))
        sources = [np.mean([each.source == source for each in rows]) for source in ("recalled", "repaired")]
        seconds = np.mean([each.duration_s for each in rows if each.duration_s is not None])
        console.print(
            f"  {way.assist:7s}{way.memory:24s} mean {mean[0]:5.2f} ({mean[1]:.2f} to {mean[2]:.2f})  "
            f"99 % {tail[0]:5.2f} ({tail[1]:.2f} to {tail[2]:.2f})  work {work:5.2f}  "
            f"recalled {100 * sources[0]:3.0f} %  repaired {100 * sources[1]:3.0f} %  drives {seconds:.1f} s",
        )
    shown = []
    for costs in wrong.values():
        means, tails, shares = zip(*costs, strict=True)
        mean, low, high = max(means, key=lambda each: float(each[0]))
        shown.append(f"{mean:.2f} [{low:.2f}, {high:.2f}], {max(tails):.2f}, {max(shares):.2f}")
    return [world, planner, f"{alone.mean():.2f}", *shown]


def main() -> None:
    """Print all that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=Path, default=Path("..") / "shared" / "worlds")
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--planners", nargs="+", default=list(PLANNERS), choices=list(PLANNERS))
    parser.add_argument("--assists", nargs="+", default=list(ASSISTS), choices=ASSISTS)
    parser.add_argument("--only", nargs="+", default=[*DRAWN, *READ], choices=[*DRAWN, *READ])
    parser.add_argument("--processor-time", action="store_true")
    asked = parser.parse_args()
    console = Console(width=180, highlight=False)
    if asked.processor_time:
        for module in ("planners.solve", "planners.world.view"):
            mock.patch(f"{module}.working_clock", time.thread_time).start()
    table: list[list[str]] = []
    for world in asked.only:
        right = memory_of(world, asked.worlds)
        memories = {"right": right, "shuffled": right}
        memories |= {wrong: memory_of(wrong, asked.worlds) for wrong in WRONG if wrong != world}
        problems = problems_of(world, "test", asked.problems, asked.worlds)
        ways = [Way("none", ""), *(Way(assist, name) for assist in asked.assists for name in memories)]
        for planner in asked.planners:
            made = attempts_of(problems, planner, ways, memories)
            table.append(report(console, world, planner, made))
    for row in (["world", "planner", "alone, ms", *asked.assists], *table):
        console.print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
