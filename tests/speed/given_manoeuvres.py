"""The manoeuvres that others wrote, each beside the best driving time that is published.

They are measured by ``python -m tests.speed manoeuvres --given``, where they lie beside the repository.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from rich.table import Table

from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.speed.manoeuvre_attempts import SEED, Peer, attempted
from tests.worlds import SHARED

REPEATS: Final = 3  # of each given problem, with other seeds
GIVEN: Final = SHARED / "manoeuvres"
VEHICLES: Final = Path("docs/vehicles/benchmarks")
_GIVEN: Final = (  # collection, file, its vehicles
    ("tpcap", "tpcap/cases.json", ("tpcap-car",)),
    ("bench-mr", "bench_mr/parking.json", ("bench-mr-car",)),
    (
        "dynobench",
        "dynobench/problems.json",
        tuple(f"dynobench-{model}" for model in ("car1-v0", "unicycle1-v0", "unicycle1-v1", "unicycle2-v0")),
    ),
)


def given_problems() -> Iterator[tuple[str, Vehicle, list[Problem]]]:
    """The problems of each collection and vehicle, in the order of their files."""
    for form, file, names in _GIVEN:
        for name in names:
            vehicle = said_vehicle(str(VEHICLES / f"{name}.yaml"))
            settings = ImportSettings(vehicle=vehicle)
            parts = [import_part(source_at(GIVEN / file, form), part, settings) for part in ("train", "test")]
            yield form, vehicle, sorted((p for part in parts for p in part.problems), key=lambda p: p.id)


def published_seconds() -> dict[str, float]:
    """The best driving time that is published for a problem, by its id."""
    with np.load(GIVEN / "tpcap" / "reference_trajectories.npz") as trajectories:
        best = {name: float(trajectories[name][-1, -1]) for name in trajectories}
    for problem in json.loads((GIVEN / "dynobench" / "problems.json").read_text())["problems"]:
        best[problem["id"]] = min(problem["published_cost_s"].values())
    return best


def given_table(planners: Sequence[Peer]) -> tuple[Table, list[str], list[str]]:
    """A row for each given problem and planner, what the authority refused, and a line for each planner."""
    table = Table(title=f"Given problems, cold, median of {REPEATS} attempts", title_justify="left")
    for column in ("collection", "problem", "planner"):
        table.add_column(column)
    for column in ("solved", "ms", "driving s", "published s", "ratio", "gear changes"):
        table.add_column(column, justify="right")
    best, refused = published_seconds(), []
    workspace, other_work = Workspace(), OtherWork()
    milliseconds: dict[Peer, list[float]] = {planner: [] for planner in planners}
    solved = dict.fromkeys(planners, 0)
    for form, vehicle, problems in given_problems():
        for planner in planners:
            attempted(problems[0], planner, vehicle, workspace, SEED - 1)
        for problem in problems:
            for planner in planners:
                rows = []
                with no_garbage_collection():
                    for repeat in range(REPEATS):
                        other_work()
                        rows.append(attempted(problem, planner, vehicle, workspace, SEED + repeat))
                refused += [f"{problem.id} {planner}: {row.fault}" for row in rows if row.fault]
                ms = 1e3 * float(np.median([row.attempt.planning_seconds for row in rows]))
                milliseconds[planner].append(ms)
                good = [row for row in rows if row.attempt.solved and row.fault is None]
                solved[planner] += len(good) == REPEATS
                driving = float(np.median([row.attempt.duration_s or 0.0 for row in good])) if good else None
                known = best.get(problem.id)
                table.add_row(
                    *(form, problem.id, str(planner), f"{len(good)}/{REPEATS}", f"{ms:.1f}"),
                    "-" if driving is None else f"{driving:.2f}",
                    "-" if known is None else f"{known:.2f}",
                    "-" if known is None or driving is None else f"{driving / known:.2f}",
                    f"{np.median([row.gear_changes for row in good]):.0f}" if good else "-",
                )
        table.add_section()
    lines = [
        f"{planner}: {solved[planner]} of {len(times)} solved, planning median {np.median(times):.1f} ms, "
        f"mean {np.mean(times):.1f} ms"
        for planner, times in milliseconds.items()
    ]
    return table, refused, lines
