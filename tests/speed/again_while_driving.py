"""Robots that plan again while they drive: what they were promised, and when they arrive.

``python -m tests.speed again_while_driving [--drives 20] [--vehicles car …] [--every 1.0] [--noise 0.0]
[--seed 501]`` draws questions through rooms with doors. The robot drives its plan, and plans again every so
many seconds from the state that it then has, with normal noise in metres and radians on its pose: handing in
the plan that it drives, or not. The judge looks at each plan. Drives that find no plan on their way count as
lost.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from time import process_time
from typing import Final, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle, name_of
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle
from tests.speed.one_version import through_doors

VEHICLES: Final = ("car", "differential-drive", "car-1-trailer")
LATE_S: Final = 0.3
HEADINGS: Final = (
    *("vehicle", "goal", "hands in its plan", "arrive", "later than promised by s: mean, most"),
    *("plans that are later by 0.3 s", "ms, mean"),
)


class Drive(NamedTuple):
    """One drive with all its plans."""

    arrived: bool
    later_s: float  # than the first plan promised
    late_plans: int  # that take so much longer than what was left of the one before
    plans: int
    seconds: float  # of processor time for all plans but the first


def _driven(
    problem: Problem,
    first: Plan,
    hands_in: bool,
    every_s: float,
    noise: float,
    vehicle: Vehicle,
    workspace: Workspace,
) -> Drive:
    """Drive to the goal. Raises AssertionError for a refused plan."""
    rng = np.random.default_rng(0)
    plan, driven_s, late, plans, seconds = first, 0.0, 0, 0, 0.0
    while (steps := round(every_s / plan.dt)) < len(plan.controls):
        driven_s += steps * plan.dt
        state = plan.states[steps].copy()
        state[:3] += noise * rng.normal(size=3)
        x, y, heading, *motion = state.tolist()
        asked = replace(problem, start=(x, y, heading), start_motion=tuple(motion))
        began = process_time()
        current = plan if hands_in else None
        again = solve(asked, "lattice", vehicle=vehicle, workspace=workspace, current=current).plan
        seconds += process_time() - began
        plans += 1
        if again is None:
            return Drive(False, 0.0, late, plans, seconds)
        assert faults(asked, again, vehicle) == []
        late += again.duration_s > plan.duration_s - steps * plan.dt + LATE_S
        plan = again
    return Drive(True, driven_s + plan.duration_s - first.duration_s, late, plans, seconds)


def report(
    console: Console,
    drives: int = 20,
    vehicles: tuple[str, ...] = VEHICLES,
    every_s: float = 1.0,
    noise: float = 0.0,
    seed: int = 501,
) -> None:
    """Print the table for so many ``drives`` of each of some ``vehicles``, to places and to poses."""
    title = f"{drives} drives each, planned again every {every_s:g} s, noise {noise:g}, seed {seed}"
    table = Table(*HEADINGS, title=title)
    for said in vehicles:
        vehicle, workspace = said_vehicle(said), Workspace()
        for pose in (False, True):
            rows: dict[bool, list[Drive]] = {False: [], True: []}
            for number in range(drives):
                problem = through_doors(np.random.default_rng([seed, number]), vehicle, pose)
                first = solve(problem, "lattice", vehicle=vehicle, workspace=workspace).plan
                for hands_in, row in rows.items():
                    if first is not None:
                        row.append(_driven(problem, first, hands_in, every_s, noise, vehicle, workspace))
            for hands_in, row in rows.items():
                table.add_row(name_of(vehicle), "pose" if pose else "place", *_cells(hands_in, row))
    console.print(table)


def _cells(hands_in: bool, row: list[Drive]) -> list[str]:
    later = np.array([drive.later_s for drive in row if drive.arrived])
    plans = sum(drive.plans for drive in row)
    return [
        *("yes" if hands_in else "no", f"{len(later)} of {len(row)}"),
        f"{later.mean():.2f}, {later.max():.1f}",
        f"{sum(drive.late_plans for drive in row)} of {plans}",
        f"{1e3 * sum(drive.seconds for drive in row) / plans:.0f}",
    ]


def main(arguments: list[str]) -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed again_while_driving", description=__doc__)
    parser.add_argument("--drives", type=int, default=20)
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES))
    parser.add_argument("--every", type=float, default=1.0)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=501)
    asked = parser.parse_args(arguments)
    console = Console(width=170)
    report(console, asked.drives, tuple(asked.vehicles), asked.every, asked.noise, asked.seed)
