"""Answers to places of vehicles unlike those that the planners were tuned for: drawn at random, or given.

``python -m tests.speed unlike_vehicles [--drawn 24] [--vehicles car docs/vehicles/bus.yaml …]
[--questions 4] [--seed 501] [--seconds 0]`` asks for places in worlds of the three classes, from any motion.
It prints for each kind of drawn vehicle, and for each given one, planning and driving times of answers that
are not improved where they take longer than expected, those of answers as they are returned, and how much
sooner the robot is there so, with the 95 % interval, questions resampled. With ``--seconds`` answers are also
improved for so long, to see what is left. Everything is timed once, cold, on one core; the authority judges
every plan.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import Any, Final, NamedTuple
from unittest import mock

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import bootstrap

from planners.search import search_and_polish as searching
from planners.search.anytime import improve
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle, name_of
from planners.world.workspace import Workspace
from storage.vehicles.definitions import vehicle_of
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.speed.general_questions import questions_of

KINDS: Final = ("car", "car-first-order", "differential-drive", "unicycle-first-order", "with a trailer")
LATER_S: Final = 0.05
HEADINGS: Final = (
    *("vehicle", "asked", "solved", "ms, before", "ms", "driving s, before", "driving s"),
    *("sooner by, s", "later", "left, s"),
)


class Answers(NamedTuple):
    """Planning and driving seconds of one question, before and now, and of the improved answer."""

    planning: tuple[float, float]
    driving: tuple[float, float]
    improved: float


def drawn_vehicle(kind: str, rng: np.random.Generator) -> Vehicle | None:
    """Draw a vehicle of a kind; None if what is drawn cannot be, or could not be checked for collisions."""

    def between(least: float, most: float) -> float:
        return float(math.exp(rng.uniform(math.log(least), math.log(most))))

    length, speed = between(0.3, 14.0), between(0.3, 12.0)
    half = 0.5 * length * rng.uniform(0.2, 0.8)
    limits: dict[str, Any] = {"speed": [-speed * float(rng.choice([1.0, 0.5, 0.2])), speed]}
    asked = {"name": "drawn", "kind": "car" if kind == KINDS[-1] else kind, "limits": limits, "step": 0.1}
    is_car = asked["kind"] in KINDS[:2]
    wheelbase = length * rng.uniform(0.45, 0.95)
    rear = (length - wheelbase) * rng.uniform(0.2, 0.8) if is_car else length * rng.uniform(0.2, 0.8)
    asked["body"] = _box(rear, length - rear, half)
    if is_car:
        asked["wheelbase"] = wheelbase
        limits["steering"] = rng.uniform(0.3, 1.1)
    else:
        limits["turn_rate"] = between(0.3, 3.0)
    if asked["kind"] == "car":
        limits |= {"acceleration": between(0.3, 4.0), "steering_rate": between(0.2, 3.0)}
    if kind == "differential-drive":
        limits |= {"acceleration": between(0.3, 4.0), "turn_acceleration": between(0.5, 8.0)}
    if rng.random() < 0.3:
        limits["lateral_acceleration"] = between(0.5, 4.0)
    if kind == KINDS[-1]:
        hitch = length * rng.uniform(0.6, 1.5)
        body = _box(0.2 * hitch, 0.6 * hitch, half)
        asked["trailers"] = [{"hitch_length": hitch, "max_hitch": rng.uniform(0.6, 1.4), "body": body}]
    try:
        return vehicle_of(asked)
    except ValueError:
        return None


def _box(rear: float, front: float, half: float) -> list[list[list[float]]]:
    return [[[-rear, -half], [front, -half], [front, half], [-rear, half]]]


def answers_of(problems: list[Problem], vehicle: Vehicle, seconds: float) -> list[Answers | None]:
    """Answer each problem without and with an improvement of what takes long, in turning order."""
    workspace, other_work = Workspace(), OtherWork()
    found: list[Answers | None] = []
    if not problems:
        return found
    for before in (True, False):
        _answer(problems[0], vehicle, workspace, before)  # compiles
    with no_garbage_collection():
        for number, problem in enumerate(problems):
            attempts = {}
            for before in (True, False) if number % 2 else (False, True):
                other_work()
                attempts[before] = _answer(problem, vehicle, workspace, before)
            planning = attempts[True].planning_seconds, attempts[False].planning_seconds
            plans = attempts[True].plan, attempts[False].plan
            if plans[0] is None or plans[1] is None:
                found.append(None)
                continue
            refused = [fault for plan in plans for fault in faults(problem, plan, vehicle)]
            assert not refused, refused
            best = plans[1]
            if seconds > 0.0:
                best = improve("lattice", problem, best, seconds=seconds, vehicle=vehicle).plan or best
            found.append(Answers(planning, (plans[0].duration_s, plans[1].duration_s), best.duration_s))
    return found


def _answer(problem: Problem, vehicle: Vehicle, workspace: Workspace, before: bool) -> Any:
    with mock.patch.object(searching, "A_SECOND", 0 if before else searching.A_SECOND):
        return solve(problem, "lattice", vehicle=vehicle, workspace=workspace)


def _asked(
    drawn: int, given: list[str], questions: int, seed: int
) -> Iterator[tuple[str, list[Problem], Vehicle]]:
    rng = np.random.default_rng(seed)
    for number in range(drawn):
        kind = KINDS[number % len(KINDS)]
        vehicle = drawn_vehicle(kind, rng)
        while vehicle is None:
            vehicle = drawn_vehicle(kind, rng)
        yield kind, _problems(vehicle, questions, seed), vehicle
    for name in given:
        vehicle = said_vehicle(name)
        yield name_of(vehicle), _problems(vehicle, questions, seed), vehicle


def _problems(vehicle: Vehicle, questions: int, seed: int) -> list[Problem]:
    return [each for name in CLASSES for each in questions_of(name, questions, vehicle, False, seed)]


def report(
    console: Console,
    drawn: int = 24,
    given: tuple[str, ...] = (),
    questions: int = 4,
    seed: int = 501,
    seconds: float = 0.0,
) -> None:
    """Print a table."""
    rows: dict[str, list[Answers | None]] = {}
    for label, problems, vehicle in _asked(drawn, list(given), questions, seed):
        rows.setdefault(label, []).extend(answers_of(problems, vehicle, seconds))
    table = Table(title="Answers to places: not improved, and as they are returned", title_justify="left")
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "vehicle" else "right")
    for label, found in rows.items():
        solved = [each for each in found if each is not None]
        if len(solved) < 2:  # of one there is no interval
            table.add_row(label, f"{len(found)}", f"{len(solved)}")
            continue
        planning, driving = (np.array([each[part] for each in solved]) for part in (0, 1))
        sooner = (planning + driving) @ [1.0, -1.0]
        low, high = bootstrap((sooner,), np.mean, rng=np.random.default_rng(1)).confidence_interval
        left = np.mean([each.driving[1] - each.improved for each in solved])
        ms, s = 1e3 * planning.mean(axis=0), driving.mean(axis=0)
        table.add_row(
            *(
                label,
                f"{len(found)}",
                f"{len(solved)}",
                f"{ms[0]:.1f}",
                f"{ms[1]:.1f}",
                f"{s[0]:.2f}",
                f"{s[1]:.2f}",
            ),
            *(f"{sooner.mean():.2f} [{low:.2f}, {high:.2f}]", f"{(sooner < -LATER_S).sum()}"),
            f"{left:.2f}" if seconds else "",
        )
    console.print(table)


def main(arguments: list[str]) -> None:
    """Print the table of other vehicles or questions."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed unlike_vehicles")
    parser.add_argument("--drawn", type=int, default=24)
    parser.add_argument("--vehicles", nargs="*", default=[])
    parser.add_argument("--questions", type=int, default=4, help="in each of the three classes")
    parser.add_argument("--seed", type=int, default=501)
    parser.add_argument("--seconds", type=float, default=0.0, help="of improvement, to see what is left")
    asked = parser.parse_args(arguments)
    report(Console(width=170), asked.drawn, tuple(asked.vehicles), asked.questions, asked.seed, asked.seconds)
