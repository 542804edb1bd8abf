"""Very many plans from fresh seeds, each judged by the authority: is one of them wrong?

``python -m tests.trials.judged_plans [--plans 1000000] [--seed 90] [--polished] [--folder build/trials]``
draws problems for every vehicle, class and difficulty in turn. Each is solved by every planner with every
assist from some seeds, and one plan of each is improved; with ``--polished`` each is solved by every planner
from scratch, and each plan is polished as plans are that a memory stores, with another margin in turn. Each
plan that differs from the others of its problem is judged and counted. Progress is kept in the folder: the
same command goes on after a kill. It ends with tables, and with exit code 1 if a plan is faulty. Each faulty
plan lies in the folder.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.attempt import Attempt
from planners.memory.memory import Memory
from planners.optimisation.polish import polish
from planners.search.query import Limits
from planners.search.registry import PLANNERS
from planners.solve import ASSISTS, WITHOUT_MEMORY, improved, solve
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES
from planners.world.workspace import Workspace
from storage.places.files import whole_file
from tests.planners.early_help import early_help
from tests.planners.memories import memory_of

EXPERIENCES: Final = 100  # problems that a memory is made of
LIMITS: Final = Limits(expansions=2_000)  # what takes longer to solve gives too few plans
SEEDS: Final = 3  # for each planner and assist
TOP_K: Final = 5
TURNED_RAD: Final = 0.2  # standard deviation of the start heading, in every second problem
IMPROVE_SECONDS: Final = 0.02
SAVE_SECONDS: Final = 10.0
KINDS: Final = list(product(VEHICLES, CLASSES, DIFFICULTIES))
IMPROVED: Final = list(product(PLANNERS, ASSISTS))  # one of these in each round of the kinds
MARGINS_M: Final = (0.0, 0.4, 0.8)  # that polished plans keep, in turn
SOURCES: Final = ("recalled", "repaired", "searched", "improved", "polished")

Counts = Counter[tuple[str, str, str, str]]  # vehicle, planner, assist, source
Attempts = Iterator[tuple[Problem, str, str, Attempt]]  # with the vehicle and the source of the plan


@cache
def memory(seed: int, vehicle: str, class_name: str) -> Memory:
    """An untrained memory of a class at ``standard``: the blocked cells find its plans."""
    source = problem_class(class_name, vehicle=VEHICLES[vehicle])
    problems = (source.draw(seed + 1, index) for index in range(EXPERIENCES))
    return memory_of(problems, VEHICLES[vehicle])


def drawn(seed: int, index: int) -> tuple[Problem, str]:
    """Problem number ``index`` and the name of its vehicle."""
    vehicle, class_name, difficulty = KINDS[index % len(KINDS)]
    problem = problem_class(class_name, difficulty, VEHICLES[vehicle]).draw(seed, index)
    if index // len(KINDS) % 2:
        x, y, heading = problem.start
        turn = TURNED_RAD * generator(seed, "turn", index).standard_normal()
        problem = replace(problem, start=(x, y, heading + turn))
    return problem, vehicle


def attempts(seed: int, index: int) -> Attempts:
    """Every attempt at problem number ``index``: with its vehicle and the source of its plan."""
    problem, name = drawn(seed, index)
    vehicle, known = VEHICLES[name], memory(seed, name, problem.class_name)
    for planner, assist, each in product(PLANNERS, ASSISTS, range(SEEDS)):
        given = None if assist in WITHOUT_MEMORY else known
        with early_help() if each else nullcontext():
            attempt = solve(problem, planner, assist, TOP_K, given, each, LIMITS, vehicle)
        yield problem, name, attempt.source or "", attempt
        if each == 0 and (planner, assist) == IMPROVED[index // len(KINDS) % len(IMPROVED)]:
            yield problem, name, "improved", improved(attempt, problem, IMPROVE_SECONDS, vehicle)


def polished(seed: int, index: int) -> Attempts:
    """Like ``attempts``: the plan of each planner, polished."""
    problem, name = drawn(seed, index)
    vehicle, margin, workspace = VEHICLES[name], MARGINS_M[index % len(MARGINS_M)], Workspace()
    for planner in PLANNERS:
        attempt = solve(problem, planner, "none", 0, None, 0, LIMITS, vehicle, workspace=workspace)
        if attempt.plan is not None:
            scene = scene_of(problem)
            better = polish(problem, attempt.plan, vehicle, scene, workspace, margin_m=margin).plan
            yield problem, name, "polished", replace(attempt, plan=better)


def judge(seed: int, index: int, folder: Path, made: Callable[[int, int], Attempts]) -> tuple[Counts, int]:
    """How many plans of problem number ``index`` were judged, and how many are faulty; these are written."""
    counts: Counts = Counter()
    faulty = 0
    met: set[bytes] = set()
    for problem, vehicle, source, attempt in made(seed, index):
        plan = attempt.plan
        if plan is None or (key := plan.states.tobytes()) in met:
            continue
        met.add(key)
        counts[vehicle, attempt.planner, attempt.assist, source] += 1
        wrong = faults(problem, plan, VEHICLES[vehicle])
        if wrong:
            faulty += 1
            asked = f"{vehicle}-{attempt.planner}-{attempt.assist}-{source}-{attempt.seed}"
            path = folder / f"faulty-{seed}-{index}-{asked}.npz"
            with whole_file(path) as temporary, temporary.open("wb") as file:
                np.savez(file, states=plan.states, controls=plan.controls, faults=wrong)
            print(f"{path.name}: {wrong[0]}", flush=True)
    return counts, faulty


def table(counts: Counts, group: int, title: str) -> Table:
    """Counts by vehicle (``group`` 0), planner (1) or assist (2), and by source."""
    result = Table(title=title, title_justify="left")
    result.add_column(("vehicle", "planner", "assist")[group])
    sources = [source for source in SOURCES if any(key[3] == source for key in counts)]
    for source in (*sources, "all"):
        result.add_column(source, justify="right")
    for name in [*dict.fromkeys(key[group] for key in sorted(counts)), None]:
        mine = {key: count for key, count in counts.items() if name in (None, key[group])}
        each = [sum(count for key, count in mine.items() if key[3] == source) for source in sources]
        result.add_row(name or "all", *(f"{count:,}" for count in (*each, sum(each))))
    return result


def main() -> int:
    """Judge until so many plans are judged; 1 if one is faulty."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=90)
    parser.add_argument("--folder", type=Path, default=Path("build") / "trials")
    parser.add_argument("--polished", action="store_true", help="judge polished plans only")
    asked = parser.parse_args()
    progress = asked.folder / f"judged-{asked.seed}{'-polished' if asked.polished else ''}.json"
    index, faulty, counts = 0, 0, Counts()
    if progress.exists():
        kept = json.loads(progress.read_text())
        index, faulty = kept["next"], kept["faulty"]
        counts = Counter({tuple(key): count for *key, count in kept["counts"]})
    saved = time.monotonic()
    while True:
        done = counts.total() >= asked.plans
        if done or time.monotonic() - saved > SAVE_SECONDS:
            rows = [[*key, count] for key, count in sorted(counts.items())]
            with whole_file(progress) as temporary:
                temporary.write_text(json.dumps({"next": index, "faulty": faulty, "counts": rows}))
            saved = time.monotonic()
        if done:
            break
        more, wrong = judge(asked.seed, index, asked.folder, polished if asked.polished else attempts)
        counts += more
        faulty += wrong
        index += 1
    console = Console(width=100)
    title = f"{counts.total():,} plans for {index:,} problems, {faulty:,} of them faulty"
    for group in range(3):
        console.print(table(counts, group, title))
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
