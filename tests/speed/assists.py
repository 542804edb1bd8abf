"""Every way to use a memory, and the controls, on the same problems with the same recalled plans.

``python -m tests.speed.assists`` prints per class at ``standard`` and per planner: planning time, collision
checks, solved share, length and duration of the plans, and the paired difference of the mean time to the
planner alone and to a fresh guide. First for all problems, then for those in which none of the k recalled
plans is free: there closed box can only fail. Problems have a seed of their own: they are neither collected
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

from planners.memory.build_memory import build_memory
from planners.memory.experience import Experience
from planners.memory.hallucination.mixture import hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.labelling import label_problems
from planners.memory.labels import free_plans, sweep_plans
from planners.memory.recall import Memory, nearest
from planners.memory.training import TrainingSettings, train
from planners.search.registry import PLANNERS
from planners.solve import Attempt, solve
from planners.world.classes import CLASSES, problem_class
from planners.world.collision import scene_of
from planners.world.occupancy import occupancy_of
from planners.world.problem import Floats, Problem
from planners.world.randomness import generator
from storage.errors import StorageError
from storage.memories import load_memory, save_memory
from tasks.caching import key_of

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

Rows = dict[tuple[str, int], list[Attempt]]

RECALLING = ("closed", "open", "repair")
EVERY = [
    ("none", 0),
    ("fresh", 0),
    ("exhaustive", 0),
    *[(assist, k) for assist in RECALLING for k in (1, 5)],
    *[(f"random-{assist}", k) for assist in RECALLING for k in (1, 5)],
]


def memory_of(name: str) -> Memory:
    """A small memory of a class, from where it is kept if it is there."""
    place = KEPT / f"{name}-{key_of(COLLECTING, EXPERIENCES, HALLUCINATED, EPOCHS)}"
    try:
        return load_memory(place)
    except StorageError:
        memory = _made(name)
        save_memory(place, memory)
        return memory


def _made(name: str) -> Memory:
    source = problem_class(name)
    experiences: list[Experience] = []
    index = 0
    while len(experiences) < EXPERIENCES:
        problem = source.draw(COLLECTING, index)
        index += 1
        plan = solve(problem, "follow", seed=COLLECTING).plan
        if plan is not None:
            experiences.append(Experience(problem, plan))
    plans = [experience.plan for experience in experiences]
    sweeps = sweep_plans(plans)
    problems: list[Problem] = []
    made_for: list[int] = []
    for i, experience in enumerate(track(experiences, description=f"memory of {name}", transient=True)):
        rng = generator(COLLECTING, name, i)
        made = hallucinate(experience, {"rearrange": 1.0}, source.draw_obstacles, rng)
        problems += [problem for problem, _ in islice(made, HALLUCINATED)]
        rng = generator(COLLECTING, "no-plan", name, i)
        problems += [no_plan(sweeps, source.draw_obstacles, rng, name, j) for j in range(HALLUCINATED // 20)]
        made_for += [i] * HALLUCINATED + [-1] * (HALLUCINATED // 20)
    packed, free = label_problems(problems, sweeps)
    index_of = np.array(made_for, np.int32)
    trained = train(packed, index_of, free, TrainingSettings(epochs=EPOCHS, seed=COLLECTING))
    return build_memory(trained, plans, name)


def hard_for(memory: Memory, name: str, k: int) -> tuple[list[Problem], int]:
    """Problems in which plans are recalled and none of the first ``k`` is free, and how many were drawn."""
    found: list[Problem] = []
    drawn = 0
    while len(found) < COUNT and drawn < MOST_DRAWN:
        problem = problem_class(name).draw(MEASURING, drawn)
        drawn += 1
        recalled = nearest(memory, memory.encoder(occupancy_of(problem)), k)
        if recalled and not free_plans(memory.sweeps, scene_of(problem))[list(recalled)].any():
            found.append(problem)
    return found, drawn


def measure(
    problems: list[Problem], planner: str, asked: list[tuple[str, int]], memory: Memory, description: str
) -> Rows:
    """Attempts of every configuration on every problem, those of one problem next to each other."""
    rows: Rows = {each: [] for each in asked}
    for problem in problems[:5]:  # compiled or loaded now, not while the clock runs
        for assist, k in asked:
            solve(problem, planner, assist, max(k, 1), memory, MEASURING)
    gc.collect()
    gc.disable()
    for number, problem in enumerate(track(problems, description=description, transient=True)):
        first = number % len(asked)
        for assist, k in asked[first:] + asked[:first]:
            rows[assist, k].append(solve(problem, planner, assist, max(k, 1), memory, MEASURING))
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
    for (assist, k), made in rows.items():
        mine = times[assist, k]
        differences = [
            difference(mine, times[control, 0]) if assist != control else "–" for control in ("none", "fresh")
        ]
        result.add_row(
            planner,
            f"{assist} {k}" if k else assist,
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
    """Print tables for all problems, and for those without a free plan among the first 1, and 5."""
    for name in CLASSES:
        memory = memory_of(name)
        problems = [problem_class(name).draw(MEASURING, index) for index in range(COUNT)]
        _report(console, f"{name}, {COUNT} problems", problems, EVERY, memory)
        for k in (1, 5):
            asked = [(assist, k if assist in RECALLING else 0) for assist in ("none", "fresh", *RECALLING)]
            problems, drawn = hard_for(memory, name, k)
            title = (
                f"{name}, the {len(problems)} of {drawn} problems in which none of {k} recalled plans is free"
            )
            if problems:
                _report(console, title, problems, asked, memory)


def _report(
    console: Console, title: str, problems: list[Problem], asked: list[tuple[str, int]], memory: Memory
) -> None:
    result = table(title)
    for planner in PLANNERS:
        add(result, planner, measure(problems, planner, asked, memory, f"{title}: {planner}"))
    console.print(result)


if __name__ == "__main__":
    report(Console(width=140))
