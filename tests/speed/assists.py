"""Every way to use a memory, and the controls, on the same problems with the same recalled plans.

``python -m tests.speed.assists`` prints per class at ``standard`` and per planner: planning time, collision
checks, solved share, length and duration of the plans, and the paired difference of the mean time to the
planner alone and to a fresh guide. First for all problems, then for those in which no stored plan is
free: there closed box can only fail. Problems have a seed of their own: they are neither collected
from, nor tuned or tested on. The memory is small, made here in a minute, and kept in build/speed.
"""

from __future__ import annotations

import gc
from collections.abc import Iterable
from itertools import islice
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from planners.attempt import Attempt
from planners.memory.build_memory import build_memory
from planners.memory.encoder.training import TrainingSettings, train
from planners.memory.hallucination.mixture import hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.labelling import label_problems
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, ProblemClass, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from storage.tables.configurations import Configuration
from tasks.fan_out.keys import key_of

KEPT = Path("build") / "speed"  # not the data folder: a run wants that empty or its own
COLLECTING = 79  # seed of the stored experiences
MEASURING = 80  # seed of the problems here
EXPERIENCES = 100
HALLUCINATED = 100  # problems an experience
EPOCHS = 8
COUNT = 200  # problems a class; and at most as many in which no recalled plan is free
MOST_DRAWN = 2_500  # to find those
RESAMPLES = 2_000

SOURCES = ("recalled", "repaired")

Asked = tuple[str, str | None, int]  # assist, strategy of recall, top k
Rows = dict[Asked, list[Attempt]]

RECALLING = ("closed", "open", "repair")
NONE: Asked = ("none", None, 0)
FRESH: Asked = ("fresh", None, 0)
HARD: list[Asked] = [NONE, FRESH, *[(assist, None, 5) for assist in RECALLING]]
EVERY: list[Asked] = [
    *HARD,
    *[(assist, "encoder", k) for assist in RECALLING for k in (1, 5)],
    *[(f"random-{assist}", "random", k) for assist in RECALLING for k in (1, 5)],
]


def memory_of(
    name: str,
    difficulty: str = "standard",
    count: int = EXPERIENCES,
    hallucinated: int = HALLUCINATED,
    kept: Path = KEPT,
) -> Memory:
    """A small memory of a class, from where it is kept if it is there; ``hallucinated`` problems a plan."""
    place = kept / f"{name}-{difficulty}-{count}-{key_of(COLLECTING, hallucinated, EPOCHS)}"
    try:
        return load_memory(place)
    except StorageError:
        memory = _made(problem_class(name, difficulty), count, hallucinated)
        save_memory(place, memory)
        return memory


def _made(source: ProblemClass, count: int, hallucinated: int) -> Memory:
    name = source.name
    experiences: list[Experience] = []
    index = 0
    while len(experiences) < count:
        problem = source.draw(COLLECTING, index)
        index += 1
        plan = solve(problem, "follow", seed=COLLECTING, polished=False).plan
        if plan is not None:
            experiences.append(Experience(problem, plan))
    plans = [experience.plan for experience in experiences]
    sweeps = sweep_plans(plans)
    problems: list[Problem] = []
    made_for: list[int] = []
    for i, experience in enumerate(track(experiences, description=f"memory of {name}", transient=True)):
        rng = generator(COLLECTING, name, i)
        made = hallucinate(experience, {"rearrange": 1.0}, source.draw_obstacles, rng)
        problems += [problem for problem, _ in islice(made, hallucinated)]
        rng = generator(COLLECTING, "no-plan", name, i)
        problems += [no_plan(sweeps, source.draw_obstacles, rng, name, j) for j in range(hallucinated // 20)]
        made_for += [i] * hallucinated + [-1] * (hallucinated // 20)
    problems += [source.draw(COLLECTING, i) for i in range(index, index + count * hallucinated)]
    made_for += [-1] * (count * hallucinated)
    packed, free = label_problems(problems, sweeps)
    index_of = np.array(made_for, np.int32)
    trained = train(
        packed, index_of, free, masks_of(sweeps), TrainingSettings(epochs=EPOCHS, seed=COLLECTING)
    )
    return build_memory(trained, plans, name)


def hard_for(memory: Memory, name: str) -> tuple[list[Problem], int]:
    """Problems in which no stored plan is free, and how many were drawn to find them."""
    found: list[Problem] = []
    drawn = 0
    while len(found) < COUNT and drawn < MOST_DRAWN:
        problem = problem_class(name).draw(MEASURING, drawn)
        drawn += 1
        if not free_plans(memory.sweeps, scene_of(problem)).any():
            found.append(problem)
    return found, drawn


def measure(
    problems: list[Problem], planner: str, asked: list[Asked], memory: Memory, description: str
) -> Rows:
    """Attempts of every configuration on every problem, those of one problem next to each other."""
    rows: Rows = {each: [] for each in asked}
    workspace = Workspace()
    for problem in problems[:5]:  # compiled or loaded now, not while the clock runs
        for assist, strategy, k in asked:
            solve(
                *(problem, planner, assist, max(k, 1), memory, MEASURING),
                strategy=strategy,
                workspace=workspace,
                polished=False,
            )
    gc.collect()
    gc.disable()
    for number, problem in enumerate(track(problems, description=description, transient=True)):
        first = number % len(asked)
        for each in asked[first:] + asked[:first]:
            assist, strategy, k = each
            made = solve(
                *(problem, planner, assist, max(k, 1), memory, MEASURING),
                strategy=strategy,
                workspace=workspace,
                polished=False,
            )
            rows[each].append(made)
    gc.enable()
    return rows


def difference(milliseconds: Floats, baseline: Floats) -> str:
    """Mean paired difference with its 95 % bootstrap interval, problems resampled."""
    each = milliseconds - baseline
    drawn = np.random.default_rng(0).integers(len(each), size=(RESAMPLES, len(each)))
    low, high = np.quantile(each[drawn].mean(axis=1), [0.025, 0.975])
    return f"{each.mean():+.2f} [{low:+.2f}, {high:+.2f}]"


def table(title: str) -> Table:
    """An empty table with the columns of ``add``; rec., rep.: % answered by a recalled, a repaired plan."""
    result = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for name in ("planner", "assist"):
        result.add_column(name, no_wrap=True)
    for name in (
        "solved", "mean ms", "median", "90 %", "less none [95 %]", "less fresh [95 %]", "rec.", "rep.",
        "checks", "metres", "seconds",
    ):  # fmt: skip
        result.add_column(name, justify="right", no_wrap=True)
    return result


def add(result: Table, planner: str, rows: Rows) -> None:
    """A row a configuration; times of failures count, lengths and durations are of the plans found."""
    times = {each: 1e3 * np.array([a.planning_seconds for a in made]) for each, made in rows.items()}
    for each, made in rows.items():
        mine = times[each]
        differences = [
            difference(mine, times[control]) if each != control else "–" for control in (NONE, FRESH)
        ]
        result.add_row(
            planner,
            Configuration(each[0], each[1] or "", each[2]).label,
            f"{100.0 * np.mean([a.solved for a in made]):.1f}",
            *(f"{value:.2f}" for value in (mine.mean(), np.median(mine), np.quantile(mine, 0.9))),
            *differences,
            *(f"{100.0 * np.mean([a.source == source for a in made]):.0f}" for source in SOURCES),
            f"{np.mean([a.collision_checks for a in made]):,.0f}",
            f"{_mean(a.length_m for a in made):.1f}",
            f"{_mean(a.duration_s for a in made):.1f}",
        )
    result.add_section()


def _mean(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else float("nan")


def report(console: Console) -> None:
    """Print tables for all problems, and for those without a free plan."""
    for name in CLASSES:
        memory = memory_of(name)
        problems = [problem_class(name).draw(MEASURING, index) for index in range(COUNT)]
        _report(console, f"{name}, {COUNT} problems", problems, EVERY, memory)
        problems, drawn = hard_for(memory, name)
        title = f"{name}, the {len(problems)} of {drawn} problems in which no stored plan is free"
        if problems:
            _report(console, title, problems, HARD, memory)


def _report(
    console: Console, title: str, problems: list[Problem], asked: list[Asked], memory: Memory
) -> None:
    result = table(title)
    for planner in PLANNERS:
        add(result, planner, measure(problems, planner, asked, memory, f"{title}: {planner}"))
    console.print(result)


if __name__ == "__main__":
    report(Console(width=140))
