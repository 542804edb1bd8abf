"""How hard each problem class is, and how much 100 stored plans cover of it.

``python -m tests.speed.class_difficulty [CLASS...]`` prints, per class and difficulty: oracle@100 (share of
new problems in which one of the plans of the first 100 is free), and for each planner from scratch: share
solved, median and mean milliseconds; and RRT's mean collision checks, also in those of an empty world.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from time import perf_counter
from typing import NamedTuple

import numpy as np

from planners.search.outcome import Outcome, Status
from planners.search.registry import PLANNERS, plan
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES, problem_class
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Plan, Problem, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace

STORED = 100  # plans that the oracle may choose from
STORED_BY = "follow"  # the planner that made them
FRESH = 500  # problems that they are tried on
STORED_SEED, FRESH_SEED = 0, 1

Draw = Callable[[int, int], Problem]  # (seed, index) -> problem


class Baseline(NamedTuple):
    """One planner from scratch on the fresh problems."""

    solved: float  # share
    median_ms: float
    mean_ms: float
    checks: float  # mean


def stored_plans(draw: Draw) -> list[Plan]:
    """The plans of the first 100 problems that the planner solves."""
    plans: list[Plan] = []
    index = 0
    while len(plans) < STORED:
        problem = draw(STORED_SEED, index)
        found = plan(STORED_BY, problem, generator(STORED_SEED, problem.id, STORED_BY)).plan
        plans += [found] if found is not None else []
        index += 1
        if index > 4 * STORED:
            raise ValueError(
                f"{STORED_BY} solved {len(plans)} of {index} problems: too hard a class to store."
            )
    return plans


def oracle(draw: Draw, plans: list[Plan], fresh: int) -> tuple[float, float]:
    """Share of fresh problems in which at least one plan is free; share of pairs that are free."""
    free = np.zeros((fresh, len(plans)), bool)
    for index in range(fresh):
        scene = scene_of(draw(FRESH_SEED, index))
        free[index] = [count_free_prefix(one.states, CAR, scene) == len(one.states) for one in plans]
    return float(free.any(axis=1).mean()), float(free.mean())


def baseline(planner: str, draw: Draw, fresh: int) -> Baseline:
    """The planner from scratch on the fresh problems, failures included."""
    outcomes: list[Outcome] = []
    seconds, workspace = [], Workspace()
    for index in range(fresh):
        problem = draw(FRESH_SEED, index)
        rng = generator(FRESH_SEED, problem.id, planner)
        began = perf_counter()
        outcomes.append(plan(planner, problem, rng, workspace=workspace))
        seconds.append(perf_counter() - began)
    return Baseline(
        float(np.mean([one.status is Status.SOLVED for one in outcomes])),
        1e3 * float(np.median(seconds)),
        1e3 * float(np.mean(seconds)),
        float(np.mean([one.collision_checks for one in outcomes])),
    )


def empty(seed: int, index: int) -> Problem:
    """A problem without obstacles."""
    problem = problem_class(CLASSES[0]).draw(seed, index)
    return Problem(
        f"empty-{seed}-{index}",
        "empty",
        problem.start,
        problem.goal,
        problem.goal_radius,
        problem.bounds,
        obstacles_of([]),
    )


def rows(names: tuple[str, ...]) -> Iterator[str]:
    """The table's lines, as they are measured."""
    columns = "".join(f" | {name}: solved, median, mean ms" for name in PLANNERS)
    yield f"class | difficulty | oracle@{STORED} | one plan free{columns} | RRT checks | x empty"
    for planner in PLANNERS:
        baseline(planner, empty, 1)  # compiled or loaded now, not while the clock runs
    nothing = baseline("rrt", empty, FRESH).checks
    for name in names:
        for difficulty in DIFFICULTIES:
            draw = problem_class(name, difficulty).draw
            any_free, one_free = oracle(draw, stored_plans(draw), FRESH)
            measured = {planner: baseline(planner, draw, FRESH) for planner in PLANNERS}
            cells = "".join(
                f" | {one.solved:.1%}, {one.median_ms:.2f}, {one.mean_ms:.2f}" for one in measured.values()
            )
            checks = measured["rrt"].checks
            yield (
                f"{name} | {difficulty} | {any_free:.3f} | {one_free:.3f}{cells}"
                f" | {checks:.0f} | {checks / nothing:.1f}"
            )


if __name__ == "__main__":
    for line in rows(tuple(sys.argv[1:]) or CLASSES):
        print(line, flush=True)
