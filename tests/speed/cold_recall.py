"""Cold recall: what a memory costs an attempt, by part, and what the robot's whole call takes.

``python -m tests.speed cold_recall`` makes every call once a problem, with other calls, other problems and
4 MB of other data between two calls for the same problem, as the benchmark does. Printed are microseconds:
the median and the 99 % of whole calls, and medians of their parts.

First ``solve`` by ``closed 5`` with 100 plans: planning time until the plan is there, or until it is known
that none of those checked is free ("whole"); of this drawing, encoding, ranking, making the scene and
checking; "rest" is what belongs to none of these, "after" is what ``solve`` does when the clock has stopped.
Then the robot's call, its plan not judged, from JSON and from arrays of polygons, which are checked, and both
in a frame of their own; "recalled" says how many problems a stored plan answered, and only these count here.
Problems have a seed of their own: they are neither collected from, nor tuned or tested on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any, Final

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import motion_memory
from planners.memory.memory import Memory
from planners.memory.recall import default_recall
from planners.solve import solve
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem, obstacles_of
from planners.world.workspace import Workspace
from storage.exchange.problems import fields_of
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.speed.assists import memory_of

MEASURING: Final = 88
COUNT: Final = 400  # problems a class
STRATEGIES: Final = ("exhaustive", "mask", "encoder")
PARTS: Final = ("occupancy", "encode", "recall", "scene", "check")
TURN: Final = 0.7  # radians: the frame of their own of problems from arrays
FAR: Final = (120.0, -80.0)  # metres: its origin


def each_once(calls: Sequence[Sequence[Callable[[], Any]]]) -> list[list[tuple[float, Any]]]:
    """Seconds and result of each of ``calls [ways][problems]``, other ways, problems and data in between."""
    between = OtherWork()
    made: list[list[tuple[float, Any]]] = [[] for _ in calls]
    with no_garbage_collection():
        for turn in range(len(calls)):
            for number in range(len(calls[0])):
                who = (number + turn) % len(calls)
                between()
                began = perf_counter()
                result = calls[who][number]()
                made[who].append((perf_counter() - began, result))
    return made


def moved(problem: Problem) -> Problem:
    """The same problem in another frame."""
    cos, sin = math.cos(TURN), math.sin(TURN)
    turn = np.array([[cos, sin], [-sin, cos]])
    x, y, heading = problem.start
    (x, y), goal = np.array([[x, y], problem.goal]) @ turn + FAR
    x_min, y_min, x_max, y_max = problem.bounds
    corners = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]]) @ turn + FAR
    low, high = corners.min(0), corners.max(0)
    return replace(
        problem,
        start=(float(x), float(y), heading + TURN),
        goal=(float(goal[0]), float(goal[1])),
        bounds=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        obstacles=obstacles_of([[piece @ turn + FAR] for piece in problem.obstacles.pieces()]),
    )


def from_arrays(planner: motion_memory.Memory, problem: Problem) -> motion_memory.Answer:
    """The robot's call for the polygons of a problem."""
    vertices, polygon_starts, _ = problem.obstacles
    return planner.plan_arrays(
        *(problem.start, problem.goal, vertices, polygon_starts, problem.goal_radius, problem.bounds)
    )


def report_solve(table: Table, name: str, memory: Memory, problems: Sequence[Problem]) -> None:
    """Add a row a strategy."""
    workspace = Workspace()

    def calls(some: Sequence[Problem]) -> list[list[Callable[[], Any]]]:
        return [
            [
                partial(
                    *(solve, each, "gust", "closed", 5, memory),
                    strategy=strategy,
                    workspace=workspace,
                    polished=False,
                )
                for each in some
            ]
            for strategy in STRATEGIES
        ]

    each_once(calls(problems[:10]))  # compiled or loaded now, not while the clock runs
    for strategy, made in zip(STRATEGIES, each_once(calls(problems)), strict=True):
        parts = [np.array([getattr(a, f"{part}_seconds") for _, a in made]) for part in PARTS]
        answered = np.array([a.source == "recalled" for _, a in made])
        known = np.sum(parts, axis=0)
        if strategy != "exhaustive":
            known = known - parts[PARTS.index("scene")]  # made for the planner alone
        planned = np.where(answered, [a.planning_seconds for _, a in made], known)
        after = np.array([seconds - a.planning_seconds for seconds, a in made])
        shown = [np.median(planned), np.quantile(planned, 0.99), *(np.median(part) for part in parts)]
        shown += [np.median((planned - np.sum(parts, axis=0))[answered]), np.median(after)]
        table.add_row(
            name, strategy, f"{100 * answered.mean():.1f}", *(f"{1e6 * each:.0f}" for each in shown)
        )


def report_robot(table: Table, name: str, memory: Memory, problems: Sequence[Problem]) -> None:
    """Add a row for each way to hand in a problem."""
    settings = "gust", "repair", 5, default_recall(memory), 1
    planner = motion_memory.Memory(memory, *settings, judged=False, polished=False)

    def calls(some: Sequence[Problem]) -> dict[str, list[Callable[[], Any]]]:
        texts = [json.dumps(fields_of(each)) for each in some]
        turned = [moved(each) for each in some]
        return {
            "JSON": [partial(planner.plan, text) for text in texts],
            "JSON, turned": [partial(planner.plan, json.dumps(fields_of(each))) for each in turned],
            "arrays": [partial(from_arrays, planner, each) for each in some],
            "arrays, turned": [partial(from_arrays, planner, each) for each in turned],
        }

    each_once([*calls(problems[:10]).values()])
    ways = calls(problems)
    for way, made in zip(ways, each_once([*ways.values()]), strict=True):
        recalled = [(seconds, answer) for seconds, answer in made if answer.source == "recalled"]
        whole = np.array([seconds for seconds, _ in recalled])
        planned = np.array([answer.planning_seconds for _, answer in recalled])
        shown = (np.median(whole), np.quantile(whole, 0.99), np.median(planned), np.median(whole - planned))
        share = f"{100 * len(recalled) / len(made):.1f}"
        table.add_row(name, way, share, *(f"{1e6 * each:.0f}" for each in shown))


def report(console: Console) -> None:
    """Print both tables."""
    solved = _table("solve, µs", "recalled", "whole", "99 %", *PARTS, "rest", "after")
    robot = _table("the robot's call, µs", "recalled", "whole", "99 %", "planning", "around")
    for name in CLASSES:
        memory = memory_of(name)
        problems = [problem_class(name).draw(MEASURING, index) for index in range(COUNT)]
        report_solve(solved, name, memory, problems)
        report_robot(robot, name, memory, problems)
    console.print(solved)
    console.print(robot)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for column in ("class", "way"):
        table.add_column(column, no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    return table


if __name__ == "__main__":
    report(Console(width=130))
