"""Vehicles in docs/vehicles, from scratch and by command: are they answered, how soon, how long is the drive?

``python -m tests.trials.vehicle_files FOLDER [VEHICLE.yaml …]`` does three things for each. It solves 50
problems of each class with each planner, and has every plan judged. It asks for 50 poses at rest in worlds of
each class, for first plans and for improved ones, all judged. Then it calls the command line as a user
would: a smoke run of one class, one plan with the memory of that run, one route over a map of the vehicle's
size, each with the file as ``--vehicle`` and all of it below FOLDER. It prints rows of Markdown.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow.dataset as ds

from planners.maps.questions import question_in
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.vehicles.vehicle import Vehicle, name_of
from planners.world.workspace import Workspace
from storage.exchange.problems import write_problems
from storage.places.data_folder import DataFolder
from storage.vehicles.vehicle_files import read_vehicle

COUNT: Final = 50
CLASS: Final = "random"
SIZE: Final = 240  # cells of a map, each as many metres wide as make a canonical one
EXAMPLES: Final = sorted((Path(__file__).parents[2] / "docs" / "vehicles").glob("*.yaml"))


def from_scratch(vehicle: Vehicle) -> list[str]:
    """A row of Markdown for each planner: what was solved, median planning (ms) and driving time (s)."""
    rows, workspace = [], Workspace()
    for planner in PLANNERS:
        solved, refused, seconds, driven = 0, 0, [], []
        for name in CLASSES:
            drawn = problem_class(name, vehicle=vehicle)
            for index in range(COUNT):
                problem = drawn.draw(7, index)
                attempt = solve(
                    problem, planner, vehicle=vehicle, seed=1, workspace=workspace, polished=False
                )
                if attempt.plan is not None:
                    solved += 1
                    refused += bool(faults(problem, attempt.plan, vehicle))
                    seconds.append(attempt.planning_seconds)
                    driven.append(attempt.plan.duration_s)
        total = COUNT * len(CLASSES)
        times = f"{1e3 * np.median(seconds):.2f} ms | {np.median(driven):.1f} s" if solved else "- | -"
        rows.append(f"| {name_of(vehicle)} | {planner} | {solved} of {total} | {refused} | {times} |")
    return rows


def to_poses(vehicle: Vehicle) -> str:
    """A row of Markdown: how many poses are reached; median and mean planning (ms), and mean driving (s)."""
    workspace, cells = Workspace(), []
    asked = []
    for name in CLASSES:
        drawn = problem_class(name, vehicle=vehicle)
        questions = (question_in(drawn.draw(7, k), k, 7, vehicle, pose=True) for k in range(COUNT))
        asked += [to_canonical(question)[0] for question in questions if question is not None]
    for polished in (False, True):
        seconds, driven, refused = [], [], 0
        solve(asked[0], "lattice", vehicle=vehicle, workspace=workspace, polished=polished)  # compiles
        for problem in asked:
            attempt = solve(
                problem, "lattice", vehicle=vehicle, seed=1, workspace=workspace, polished=polished
            )
            if attempt.plan is not None:
                seconds.append(1e3 * attempt.planning_seconds)
                driven.append(attempt.plan.duration_s)
                refused += bool(faults(problem, attempt.plan, vehicle))
        times = f"{np.median(seconds):.1f} | {np.mean(seconds):.1f} | {np.mean(driven):.2f}"
        cells.append(f"{len(driven)} of {len(asked)} | {refused} | {times}")
    return f"| {name_of(vehicle)} | " + " | ".join(cells) + " |"


def by_command(file: Path, folder: Path) -> str:
    """A row of Markdown: what a run, a plan and a route of the command line brought."""
    vehicle, data = read_vehicle(file), folder / file.stem
    _call("run", "--preset", "smoke", "--classes", CLASS, "--workers", "1", "--data", data, "--vehicle", file)
    (run,) = DataFolder(data.absolute()).runs()
    rows = ds.dataset(sorted(run.results.rglob("*.parquet"))).to_table().to_pandas()
    mine = rows[(rows.planner == "lattice") & rows.polished]  # as answers are returned
    cells = []
    for assist in ("none", "repair"):
        each = mine[(mine.assist == assist)]
        recalled = each[each.source.isin(["recalled", "repaired"])]
        share = "" if assist == "none" else f", {len(recalled)} from memory"
        median = f"{1e3 * each.planning_seconds.median():.2f} ms, {each.duration_s.median():.1f} s"
        cells.append(f"{int(each.solved.sum())} of {len(each)}{share}; {median}")
    problem, plan, drive = (data / name for name in ("problem.json", "plan.json", "drive.json"))
    write_problems(problem, [problem_class(CLASS, vehicle=vehicle).draw(11, 0)], vehicle)
    told = _call("plan", problem, "--vehicle", file, "--memory", run.path, "--out", plan)
    assert json.loads(plan.read_text())["vehicle"]["name"] == file.stem
    cells.append(next(line for line in told.splitlines() if " ms" in line))
    scale, grid = vehicle.scale, folder / "map.npy"
    np.save(grid, _map())
    ends = ["--from", f"{20 * scale},{20 * scale},0.8", "--to", f"{200 * scale},{210 * scale}"]
    told = _call("route", grid, *ends, "--resolution", scale, "--vehicle", file, "--out", drive)
    cells.append(next((line for line in told.splitlines() if " m in " in line), told.splitlines()[0]).strip())
    return f"| {file.stem} | {scale:g} | " + " | ".join(cells) + " |"


def _map() -> np.ndarray[Any, Any]:
    """A map ``[rows, columns]`` of blocks between streets, 1 occupied."""
    cells = np.zeros((SIZE, SIZE), np.uint8)
    for row in range(40, SIZE - 30, 40):
        for column in range(40, SIZE - 30, 40):
            cells[row : row + 18, column : column + 18] = 1
    return cells


def _call(*arguments: object) -> str:
    """The output of a command; the error's text instead if it fails."""
    command = [sys.executable, "-m", "flows.cli.main", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode and arguments[0] != "route":
        raise AssertionError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout if done.returncode == 0 else done.stderr.strip().splitlines()[-1]


def main() -> None:
    """Print the three tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("files", type=Path, nargs="*", default=EXAMPLES)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for file in options.files:
        print(*from_scratch(read_vehicle(file)), sep="\n", flush=True)
    for file in options.files:
        print(to_poses(read_vehicle(file)), flush=True)
    for file in options.files:
        print(by_command(file, options.folder), flush=True)


if __name__ == "__main__":
    main()
