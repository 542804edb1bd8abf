"""FLASK beside the lattice: a differential drive asked for poses from rest, on the same city maps.

``python -m tests.speed.peers.flask [--questions 100] [--memory LIBRARY]`` needs the wheel ``nav-planning``,
the planner of Duong et al. (IEEE T-RO 2026) for the LoCoBot. The questions are those of
``tests.speed.general_questions --poses`` for ``docs/vehicles/benchmarks/locobot.yaml``, from rest. FLASK is
given the obstacles as points on their edges, one each ``SPACING`` metres and at each of ``HEIGHTS``; the time
that it takes to sort these is told apart from its planning. Our body lies around all of its spheres, so what
is free for us is free for FLASK. Our plans are judged by the authority. FLASK's steer continuously, which the
authority cannot drive again: what is looked at, each 10 ms, is whether a disc inside its body meets anything.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from time import thread_time
from typing import Final, NamedTuple

import numpy as np
import shapely
from nav_planning._ompl_vamp import KinodynamicSettings, OmplVampPlanner
from nav_planning.locobot import (
    BASE_MAX_ACCELERATION,
    BASE_MAX_SPEED,
    BASE_MAX_YAW_ACCELERATION,
    BASE_MAX_YAW_RATE,
)
from rich.console import Console
from rich.table import Table

from planners.memory.library.plan_library import PlanLibrary
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.speed.general_questions import CITIES, SEED, questions_of
from tests.speed.statistics import with_interval

VEHICLE: Final = "docs/vehicles/benchmarks/locobot.yaml"
SPACING: Final = 0.03  # metres, between points on an edge: a sphere gets 2 mm between two
HEIGHTS: Final = np.array([0.02, 0.05, 0.08])  # metres, where the base's spheres reach farthest out
INSIDE: Final = 0.18  # metres: radius of a disc inside FLASK's body
LIMIT_S: Final = 2.0


class Answer(NamedTuple):
    """One attempt."""

    driving_s: float  # NaN without a plan
    milliseconds: float  # of planning
    sorting_ms: float  # of making the obstacles ready, where that is told apart
    faulty: bool


Way = Callable[[Problem], Answer]


def asked_of(name: str, count: int, vehicle: Vehicle) -> Iterator[Problem]:
    """Questions of a city, from rest."""
    for question in questions_of(name, count, vehicle, pose=True):
        yield replace(question, start_motion=())


def ours(
    assist: str,
    polished: bool,
    vehicle: Vehicle,
    library: PlanLibrary | None,
    workspace: Workspace,
    question: Problem,
) -> Answer:
    """The lattice's attempt."""
    began = thread_time()
    attempt = solve(
        *(question, "lattice", assist, 1, library, SEED),
        vehicle=vehicle,
        workspace=workspace,
        polished=polished,
    )
    spent = thread_time() - began
    wrong = attempt.plan is not None and bool(faults(question, attempt.plan, vehicle))
    return Answer(attempt.duration_s if attempt.solved else math.nan, 1e3 * spent, 0.0, wrong)


@lru_cache(maxsize=1)  # both of FLASK's ways get the same
def _planner(question: Problem, scale: float) -> tuple[OmplVampPlanner, shapely.STRtree, float]:
    """FLASK with the obstacles of a question, these as polygons, and the ms that sorting them took."""
    pieces = [scale * piece for piece in question.obstacles.pieces()]
    planner = OmplVampPlanner("locobot", [0, 1, 2], [0.0] * 5)
    low, high = planner.default_joint_limits()
    low[:2], high[:2] = scale * np.array(question.bounds).reshape(2, 2)
    planner.set_joint_limits(low, high)
    points = _points(pieces)
    began = thread_time()
    if len(points):
        planner.add_pointcloud(points, 0.0)
    took = 1e3 * (thread_time() - began)
    return planner, shapely.STRtree([shapely.Polygon(piece) for piece in pieces]), took


def flask(simplify: bool, scale: float, question: Problem) -> Answer:
    """FLASK's attempt; ``scale`` metres are one of the question's."""
    planner, world, sorting = _planner(question, scale)
    settings = KinodynamicSettings()
    settings.max_velocity, settings.max_acceleration = [], []
    settings.base_max_speed, settings.base_max_acceleration = BASE_MAX_SPEED, BASE_MAX_ACCELERATION
    settings.base_max_yaw_rate = BASE_MAX_YAW_RATE
    settings.base_max_yaw_acceleration = BASE_MAX_YAW_ACCELERATION
    settings.simplify, settings.seed = simplify, SEED
    assert question.arrival is not None
    assert question.arrival.heading is not None
    start = [scale * question.start[0], scale * question.start[1], question.start[2]]
    goal = [scale * question.goal[0], scale * question.goal[1], question.arrival.heading]
    began = thread_time()
    found = planner.plan_kinodynamic(start, [], goal, LIMIT_S, settings)
    spent = 1e3 * (thread_time() - began)
    if not found.solved:
        return Answer(math.nan, spent, sorting, False)
    _, positions, _, _ = found.trajectory.sample_uniform(0.01)
    met = world.query(shapely.points(positions[:, :2]), predicate="dwithin", distance=INSIDE)
    return Answer(found.trajectory.duration, spent, sorting, met.size > 0)


def _points(pieces: list[Floats]) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Points ``[n, 3]`` on the edges of pieces, metres."""
    edges = []
    for piece in pieces:
        for a, b in zip(piece, np.roll(piece, -1, axis=0), strict=True):
            share = np.linspace(0.0, 1.0, max(2, math.ceil(math.dist(a, b) / SPACING)), endpoint=False)
            edges.append(a + share[:, None] * (b - a))
    flat = np.unique(np.round(np.concatenate(edges or [np.empty((0, 2))]), 4), axis=0)
    return np.column_stack((np.tile(flat, (len(HEIGHTS), 1)), np.repeat(HEIGHTS, len(flat)))).astype(
        np.float32
    )


def report(console: Console, count: int, memory: Path | None) -> None:
    """Ask everybody everything, one question after another, and print a row for each way and city."""
    vehicle = said_vehicle(VEHICLE)
    library = None if memory is None else load_library(memory, vehicle)
    workspace, other_work = Workspace(), OtherWork()
    ways: dict[str, Way] = {
        "lattice, first plan": partial(ours, "none", False, vehicle, None, workspace),
        "lattice": partial(ours, "none", True, vehicle, None, workspace),
        "FLASK, first plan": partial(flask, False, vehicle.scale),
        "FLASK, smoothed": partial(flask, True, vehicle.scale),
    }
    if library is not None:
        ways["lattice, library"] = partial(ours, "closed", True, vehicle, library, workspace)
    table = Table(title=f"{count} questions a city: locobot, poses from rest", title_justify="left")
    for column in ("city", "planner"):
        table.add_column(column)
    for column in ("solved", "median ms [95 %]", "mean", "99 %", "obstacles ms", "driving s", "faulty"):
        table.add_column(column, justify="right")
    for name in CITIES:
        answers: dict[str, list[Answer]] = {way: [] for way in ways}
        names, questions = list(ways), list(asked_of(name, count, vehicle))
        for way, question in product(ways.values(), questions[:3]):
            way(question)  # compiles
        with no_garbage_collection():
            for number, question in enumerate(questions):
                turn = number % len(names)
                for way in names[turn:] + names[:turn]:
                    other_work()
                    answers[way].append(ways[way](question))
        both = np.all([[math.isfinite(each.driving_s) for each in rows] for rows in answers.values()], axis=0)
        for way, rows in answers.items():
            driving, ms, sorting, faulty = np.array(rows).T
            table.add_row(
                *(name, way, f"{np.isfinite(driving).mean():.1%}", with_interval(ms, ".2f")),
                *(f"{ms.mean():.2f}", f"{np.quantile(ms, 0.99):.1f}", f"{sorting.mean():.1f}"),
                *(f"{driving[both].mean():.1f}" if both.any() else "-", f"{faulty.sum():.0f}"),
            )
        table.add_section()
    console.print(table)
    console.print("Driving: means over the questions that all of them solve. Times are the processor's.")


def main() -> None:
    """Read the options and report."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.speed.peers.flask",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--questions", type=int, default=100, help="a city")
    parser.add_argument("--memory", type=Path, help="a library of the same vehicle")
    asked = parser.parse_args()
    report(Console(width=130), asked.questions, asked.memory)


if __name__ == "__main__":
    main()
