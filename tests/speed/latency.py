"""Recall by every strategy: problem in, k checked plans out, at batch 1, one thread, 100 stored plans.

``python -m tests.speed.latency`` prints per class at ``standard`` and per strategy: how often one of the
first 1, and of the 5, recalled plans is free (hit@1, hit@5; oracle: any of the 100 is), and the time of 5,
from the problem's obstacles to the plan that is free or the knowledge that none of them is: median, 90 and
99 %, mean, and the medians of its parts: drawing, encoding, ranking, making the scene, checking. Then what a
whole planner makes of it. Problems have a seed of their own: they are neither collected from, nor tuned or
tested on.
"""

from __future__ import annotations

import gc
from time import perf_counter

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from planners.memory.memory import Memory
from planners.memory.plans.free import free_plans
from planners.memory.recall import STRATEGIES, recall
from planners.solve import solve
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.view import View
from planners.world.workspace import Workspace
from tests.speed.assists import memory_of

MEASURING = 81  # seed of the problems here
COUNT = 1000  # problems a class
TOP_K = 5
PARTS = ("occupancy", "encode", "recall", "scene", "check")
PLANNER = "gust"
PLANNED = 300  # problems a class that are planned for
ASSISTS = ("none", "closed", "open", "repair")
WORKSPACE = Workspace()  # for every attempt: all are made in one thread


def hits(memory: Memory, problems: list[Problem], strategy: str) -> list[tuple[bool, bool]]:
    """Whether the first recalled plan, and any of the first five, is free in each problem."""
    found = []
    for problem in problems:
        free = free_plans(memory.sweeps, scene_of(problem))
        first, five = (
            recall(memory, View(problem), strategy, k, generator(MEASURING, problem.id)) for k in (1, TOP_K)
        )
        found.append((bool(free[list(first.plans)].any()), bool(free[list(five.plans)].any())))
    return found


def latencies(memory: Memory, problems: list[Problem]) -> dict[str, list[dict[str, float]]]:
    """Seconds by part of each recall, "whole" the whole; strategies next to each other, in turn first."""
    rows: dict[str, list[dict[str, float]]] = {strategy: [] for strategy in STRATEGIES}
    gc.collect()
    gc.disable()
    for number, problem in enumerate(track(problems, description=memory.class_name, transient=True)):
        first = number % len(STRATEGIES)
        for strategy in STRATEGIES[first:] + STRATEGIES[:first]:
            rng = generator(MEASURING, problem.id) if strategy == "random" else None
            view = View(problem, WORKSPACE)
            recall(memory, view, strategy, TOP_K, rng)
            rows[strategy].append({"whole": perf_counter() - view.began, **view.seconds})
    gc.enable()
    return rows


def report(console: Console) -> None:
    """Print a table a class, and one of planning times."""
    planned = _table("Planning with the default recall, 5 plans", "class", "assist", "mean µs", "less none")
    for name in CLASSES:
        memory = memory_of(name)
        problems = [problem_class(name).draw(MEASURING, index) for index in range(COUNT)]
        latencies(memory, problems[:20])  # compiled or loaded now, not while the clock runs
        rows = latencies(memory, problems)
        oracle = np.mean([free_plans(memory.sweeps, scene_of(problem)).any() for problem in problems])
        title = f"{name}, {COUNT} problems, oracle@{len(memory.plans)} {100 * oracle:.1f} %, µs"
        table = _table(title, "strategy", "hit@1", "hit@5", "median", "90 %", "99 %", "mean", *PARTS)
        for strategy in STRATEGIES:
            one, five = np.mean(hits(memory, problems, strategy), axis=0)
            whole = 1e6 * np.array([row["whole"] for row in rows[strategy]])
            parts = [1e6 * np.median([row.get(part, 0.0) for row in rows[strategy]]) for part in PARTS]
            times = (np.median(whole), *np.quantile(whole, (0.9, 0.99)), whole.mean(), *parts)
            table.add_row(
                strategy, *(f"{100 * share:.1f}" for share in (one, five)), *(f"{each:.0f}" for each in times)
            )
        console.print(table)
        _plan(planned, name, memory, problems[:PLANNED])
    console.print(planned)


def _plan(table: Table, name: str, memory: Memory, problems: list[Problem]) -> None:
    """Add a class's planning times, all assists of one problem next to each other."""
    seconds: dict[str, list[float]] = {assist: [] for assist in ASSISTS}
    for number, problem in enumerate(problems):
        first = number % len(ASSISTS)
        for assist in ASSISTS[first:] + ASSISTS[:first]:
            asked = problem, PLANNER, assist, TOP_K, memory, MEASURING
            made = solve(*asked, workspace=WORKSPACE, polished=False)
            seconds[assist].append(made.planning_seconds)
    alone = np.mean(seconds["none"])
    for assist, each in seconds.items():
        less = "" if assist == "none" else f"{100 * (1 - np.mean(each) / alone):.1f} %"
        table.add_row(name, f"{PLANNER}, {assist}", f"{1e6 * np.mean(each):.0f}", less)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for number, column in enumerate(columns):
        table.add_column(column, justify="right" if number else "left", no_wrap=True)
    return table


if __name__ == "__main__":
    report(Console(width=130))
