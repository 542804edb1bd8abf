"""Plans of canonical problems: of every planner with every assist, or polished as a memory stores them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Final

from planners.attempt import WITHOUT_MEMORY
from planners.memory.memory import Memory
from planners.optimisation.polish import polish
from planners.search.query import Limits
from planners.search.registry import PLANNERS
from planners.solve import ASSISTS, improved, solve
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES
from planners.world.workspace import Workspace
from tests.planners.early_help import early_help
from tests.planners.memories import memory_of
from tests.trials.judged_plans.made import POLISHED, Made

EXPERIENCES: Final = 100  # problems that a memory is made of
LIMITS: Final = Limits(expansions=2_000)  # what takes longer to solve gives too few plans
SEEDS: Final = 3  # for each planner and assist
TOP_K: Final = 5
TURNED_RAD: Final = 0.2  # standard deviation of the start heading, in every second problem
IMPROVE_SECONDS: Final = 0.02
KINDS: Final = list(product(VEHICLES, CLASSES, DIFFICULTIES))
IMPROVED: Final = list(product(PLANNERS, ASSISTS))  # one of these in each round of the kinds
MARGINS_M: Final = (0.0, 0.4, 0.8)  # that polished plans keep, in turn


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


def attempts(seed: int, index: int) -> Iterator[Made]:
    """Every attempt at problem number ``index``, and an improved one."""
    problem, name = drawn(seed, index)
    vehicle, asked = VEHICLES[name], problem.class_name
    known = memory(seed, name, asked)
    for planner, assist, each in product(PLANNERS, ASSISTS, range(SEEDS)):
        given = None if assist in WITHOUT_MEMORY else known
        with early_help() if each else nullcontext():
            query = problem, planner, assist, TOP_K, given, each, LIMITS, vehicle
            attempt = solve(*query, polished=(index + each) % POLISHED == 0)
        yield Made(problem, vehicle, asked, attempt.source or "", attempt)
        if each == 0 and (planner, assist) == IMPROVED[index // len(KINDS) % len(IMPROVED)]:
            better = improved(attempt, problem, IMPROVE_SECONDS, vehicle)
            yield Made(problem, vehicle, asked, "improved", better)


def polished(seed: int, index: int) -> Iterator[Made]:
    """Like ``attempts``: the plan of each planner, polished."""
    problem, name = drawn(seed, index)
    vehicle, margin, workspace = VEHICLES[name], MARGINS_M[index % len(MARGINS_M)], Workspace()
    for planner in PLANNERS:
        query = problem, planner, "none", 0, None, 0, LIMITS, vehicle
        attempt = solve(*query, workspace=workspace, polished=False)
        if attempt.plan is not None:
            scene = scene_of(problem)
            better = polish(problem, attempt.plan, vehicle, scene, workspace, margin_m=margin).plan
            yield Made(problem, vehicle, problem.class_name, "polished", replace(attempt, plan=better))
