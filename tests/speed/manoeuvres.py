"""How fast manoeuvres are planned from scratch, cold, on one core, and how long the drives take.

``python -m tests.speed manoeuvres [--families …] [--difficulties …] [--vehicles …] [--questions 100] [--seed
79] [--planners …] [--optimise] [--others …] [--given]`` draws questions of the families and prints for each
family and planner the solved share, planning times (failures included), driving times and changes of gear of
what all solve, and the total: planning and driving. ``--given`` asks the problems of TPCAP, dynobench and
Bench-MR instead, where they lie beside the repository, and prints each beside the best driving time that is
published. ``--memory LIBRARY`` also has the planners join plans of a library, of the one vehicle that
``--vehicles`` names; "from memory" is the share of questions answered by a plan of which a part was stored,
and a line says how much sooner the robot is there so, with the 95 % interval, problems resampled.
``--optimise`` has every plan optimised, too, and counts that time. ``--others`` adds planners that are not
ours, for cars that reverse: Hybrid A*, and of OMPL RRT-Connect, BIT* and informed RRT* over Reeds-Shepp
curves. What they find is driven and polished as our plans are; a line says how much sooner than so the robot
is there with ours. The authority judges every plan, in the frame of its problem.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import bootstrap

from planners.search.registry import PLANNERS
from planners.world.classes.families import FAMILIES, WITH_TRAILERS, family
from planners.world.classes.problem_classes import DIFFICULTIES
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Car, Vehicle, trailers_of
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.speed.given_manoeuvres import given_table
from tests.speed.manoeuvre_attempts import OTHERS, SEED, Peer, Row, attempted

NOTICED_S: Final = 0.05  # by so much a robot is later at least to be counted as later


def measured(
    problems: Sequence[Problem], planners: Sequence[Peer], vehicle: Vehicle
) -> dict[Peer, list[Row]]:
    """Rows of each planner, cold: other data fill the caches before each attempt."""
    workspace, other_work = Workspace(), OtherWork()
    for peer in planners:
        if (library := peer.library) is not None:  # what loading a memory makes, too
            _ = library.sub_plans, library.stretches, library.endings, library.drives
    rows: dict[Peer, list[Row]] = {peer: [] for peer in planners}
    for name in planners:
        attempted(problems[0], name, vehicle, workspace, SEED + 1)  # compiles
    with no_garbage_collection():
        for number, problem in enumerate(problems):
            at = number % len(planners)
            for name in [*planners[at:], *planners[:at]]:
                other_work()
                rows[name].append(attempted(problem, name, vehicle, workspace, SEED))
    return rows


def family_table(asked: argparse.Namespace) -> tuple[Table, list[str], list[str]]:
    """The table of the families, what the authority refused, and what the library is worth."""
    title = f"Manoeuvres from scratch, {asked.questions} questions each, seed {asked.seed}"
    table = _table(title, ("family", "difficulty", "vehicle", "planner"))
    refused = []
    worth = []
    for name, difficulty, vehicle in _asked_families(asked):
        drawn = family(name, difficulty, vehicle)
        problems = [drawn.draw(asked.seed, index) for index in range(asked.questions)]
        rows = measured(problems, _peers(asked, vehicle), vehicle)
        by_all = np.all([[row.attempt.solved for row in found] for found in rows.values()], axis=0)
        for planner, found in rows.items():
            refused += [f"{row.attempt.problem_id} {planner}: {row.fault}" for row in found if row.fault]
            label = name, difficulty, vehicle.about.name.decode()
            table.add_row(*label, str(planner), *_cells(found, by_all))
        worth += [
            f"{name} {difficulty}, {planner}: {_sooner(rows[planner._replace(library=None)], found)}"
            for planner, found in rows.items()
            if planner.library is not None
        ]
        worth += [
            f"{name} {difficulty}, {planner} beside {other}: {_sooner(rows[other], rows[planner])}"
            for other in rows
            if other.planner in OTHERS
            for planner in rows
            if planner.planner not in OTHERS
        ]
        table.add_section()
    return table, refused, worth


def _sooner(others: list[Row], ours: list[Row]) -> str:
    """How much sooner the robot is there than with others, planning and driving, where both solve."""
    planning, driving = (
        np.array([[getattr(row.attempt, name) or np.nan for row in rows] for rows in (others, ours)])
        for name in ("planning_seconds", "duration_s")
    )
    by_driving = driving[0] - driving[1]
    both = ~np.isnan(by_driving)
    sooner = (planning[0] - planning[1] + by_driving)[both]
    if len(sooner) < 2:
        return f"both solve {len(sooner)}"
    low, high = bootstrap((sooner,), np.mean, rng=np.random.default_rng(1)).confidence_interval
    later = np.count_nonzero(sooner < -NOTICED_S)
    driven = by_driving[both].mean()
    return (
        f"{sooner.mean():.2f} s sooner [{low:.2f}, {high:.2f}], {driven:.2f} by driving, "
        f"later in {later} of {len(sooner)}"
    )


def _peers(asked: argparse.Namespace, vehicle: Vehicle | None = None) -> list[Peer]:
    """The planners alone, and with what is known of the vehicle's plans."""
    libraries = (
        [None] if asked.memory is None or vehicle is None else [None, load_library(asked.memory, vehicle)]
    )
    peers = [
        Peer(name, optimised, library)
        for name in asked.planners
        for library in libraries
        for optimised in [False, True][: 1 + asked.optimise]
    ]
    if isinstance(vehicle, Car) and vehicle.min_speed < 0.0:
        peers += [Peer(name, False) for name in asked.others]
    return peers


def _asked_families(asked: argparse.Namespace) -> Iterator[tuple[str, str, Vehicle]]:
    vehicles = [said_vehicle(name) for name in asked.vehicles]
    for name in asked.families:
        for vehicle in vehicles:
            if bool(trailers_of(vehicle)) == (name in WITH_TRAILERS):
                yield from ((name, difficulty, vehicle) for difficulty in asked.difficulties)


def _cells(rows: list[Row], by_all: np.ndarray) -> list[str]:
    """Solved, planning times, then of what all planners solve driving, gear changes and the total."""
    solved = np.mean([row.attempt.solved for row in rows])
    ms = 1e3 * np.array([row.attempt.planning_seconds for row in rows])
    common = [row for row, each in zip(rows, by_all, strict=True) if each]
    driving = np.array([row.attempt.duration_s or 0.0 for row in common])
    planning = np.array([row.attempt.planning_seconds for row in common])
    gears = [row.gear_changes for row in common]
    of_all = (
        [f"{driving.mean():.2f}", f"{np.mean(gears):.1f}", f"{(planning + driving).mean():.2f}"]
        if common
        else ["-", "-", "-"]
    )
    times = (np.median(ms), ms.mean(), np.quantile(ms, 0.99))
    refused = sum(row.fault is not None for row in rows)
    stored = np.mean([row.attempt.source in ("recalled", "repaired") for row in rows])
    return [f"{solved:.1%}", f"{stored:.1%}", *(f"{each:.1f}" for each in times), *of_all, str(refused)]


def _table(title: str, names: tuple[str, ...]) -> Table:
    table = Table(title=title, title_justify="left")
    for column in names:
        table.add_column(column, no_wrap=True)
    for column in (
        "solved",
        "from memory",
        "median ms",
        "mean",
        "99 %",
        "driving s",
        "gears",
        "total s",
        "refused",
    ):
        table.add_column(column, justify="right")
    return table


def report(console: Console, asked: argparse.Namespace | None = None) -> None:
    """Measure and print; AssertionError where the authority refused a plan."""
    asked = asked or _parser().parse_args([])
    if asked.given:
        table, refused, lines = given_table(_peers(asked))
    else:
        table, refused, lines = family_table(asked)
    console.print(table)
    for line in lines:
        console.print(line)
    assert not refused, f"The authority refused {len(refused)} plans; the first: {refused[0]}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="manoeuvres", description=__doc__)
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument("--difficulties", nargs="+", choices=DIFFICULTIES, default=["standard"])
    parser.add_argument(
        "--vehicles", nargs="+", default=["car", "car-1-trailer"], help="names or .yaml files"
    )
    parser.add_argument("--questions", type=int, default=100, help="of each family")
    parser.add_argument("--seed", type=int, default=SEED, help="of the questions")
    parser.add_argument("--planners", nargs="+", choices=PLANNERS, default=["lattice"])
    parser.add_argument("--memory", type=Path, help="a library of `gather`, of the one vehicle that is asked")
    parser.add_argument("--optimise", action="store_true", help="optimise each plan too")
    parser.add_argument("--others", nargs="+", choices=OTHERS, default=[], help="planners that are not ours")
    parser.add_argument("--given", action="store_true", help="ask the problems of others instead")
    return parser


def main(arguments: list[str]) -> None:
    """Read the options and report."""
    report(Console(width=150), _parser().parse_args(arguments))
