"""Kin of the published manoeuvres: how many are solved, cold, with the default budget, and how fast.

``python -m tests.speed kin [--each 1] [--seed 7] [--collections …] [--out kin.jsonl]`` asks the given worlds
of TPCAP, Bench-MR and dynobench otherwise: mirrored, turned, with their ends exchanged, with one obstacle
moved, between new poses anywhere or close to obstacles, and for the other vehicles of the collection; and
typical shapes: bug traps, kinks, gaps, slots and dead ends. What is not solved is listed; some of it cannot
be. The authority judges every plan, in the frame of its problem.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.exchange.problems import fields_of
from storage.vehicles.vehicle_files import said_vehicle
from tests.speed.given_manoeuvres import VEHICLES, given_problems
from tests.speed.kin_problems import checked, kin_of, shapes
from tests.speed.manoeuvre_attempts import SEED, Peer, attempted

SHAPED: Final = (
    *("car", "car-1-trailer", f"{VEHICLES}/tpcap-car.yaml"),
    *(
        f"{VEHICLES}/dynobench-{model}.yaml"
        for model in ("car1-v0", "car2-v0", "unicycle1-v0", "unicycle2-v0", "unicycle-first-order-0")
    ),
)
ALSO: Final = ("car2-v0", "unicycle-first-order-0")  # vehicles of dynobench without a given problem
NEVER: Final = ("dynobench-unicycle1-v1",)  # who cannot stand has few kin that can be solved


def kin(each: int, seed: int, collections: Sequence[str]) -> Iterator[tuple[str, str, Vehicle, Problem]]:
    """Collection, what was done, vehicle and problem."""
    given = list(given_problems()) if set(collections) - {"shapes"} else []
    worlds = {
        form: [(v, p) for f, v, problems in given if f == form for p in problems]
        for form in dict.fromkeys(f for f, _, _ in given)
    }
    for form in [name for name in worlds if name in collections]:
        vehicles = {v.about.name: v for v, _ in worlds[form]}
        if form == "dynobench":
            more = [said_vehicle(str(VEHICLES / f"dynobench-{model}.yaml")) for model in ALSO]
            vehicles |= {v.about.name: v for v in more}
        for number, (own, problem) in enumerate(worlds[form]):
            for vehicle in vehicles.values():
                if vehicle.about.name.decode() in NEVER:
                    continue
                for again in range(each):
                    rng = np.random.default_rng([seed, number, again, *vehicle.about.name])
                    fields = fields_of(problem, own)
                    if vehicle is not own:
                        fields = _for_another(fields, vehicle)
                    for what, changed in kin_of(fields, vehicle, rng):
                        name = f"{problem.id} {what} {vehicle.about.name.decode()} {again}"
                        found = None if changed is None else checked(changed, name, vehicle)
                        if found is not None:
                            yield form, what, vehicle, found
    if "shapes" in collections:
        for name in SHAPED:
            vehicle = said_vehicle(name)
            for again in range(3 * each):
                rng = np.random.default_rng([seed, again, *vehicle.about.name])
                for what, fields in shapes(vehicle, rng):
                    asked = _for_another(fields, vehicle)
                    found = checked(asked, f"{what} {vehicle.about.name.decode()} {again}", vehicle)
                    if found is not None:
                        yield "shapes", what, vehicle, found


def _for_another(fields: dict[str, object], vehicle: Vehicle) -> dict[str, object]:
    """The problem for a vehicle that is not its own: within 5 cm and 1 degree, or 4 cm for small ones."""
    kept = {name: fields[name] for name in ("start", "goal", "bounds", "obstacles")}
    small = vehicle.scale < 1.0
    return kept | {"goal_tolerance": [0.04, 0.06] if small else [0.05, 0.0175]}


def report(console: Console, asked: argparse.Namespace | None = None) -> None:
    """Measure and print; AssertionError where the authority refused a plan."""
    asked = asked or _parser().parse_args([])
    rows: dict[tuple[str, str], list[tuple[bool, float]]] = defaultdict(list)
    refused, unsolved, lines = [], [], []
    workspace, planner = Workspace(), Peer("lattice", optimised=False)
    compiled = set()
    for form, what, vehicle, problem in kin(asked.each, asked.seed, asked.collections):
        name = vehicle.about.name.decode()
        if name not in compiled:
            attempted(problem, planner, vehicle, workspace, SEED - 1)
            compiled.add(name)
        row = attempted(problem, planner, vehicle, workspace, SEED)
        refused += [f"{problem.id}: {row.fault}"] if row.fault else []
        unsolved += [] if row.attempt.solved else [f"{form} {problem.id}: {row.attempt.status}"]
        rows[form, name].append((row.attempt.solved, 1e3 * row.attempt.planning_seconds))
        fields = fields_of(problem, vehicle)
        about = {"collection": form, "kind": what, "driver": name, "solved": row.attempt.solved}
        about |= {"ms": rows[form, name][-1][1], "driving_s": row.attempt.duration_s}
        lines.append(json.dumps({**about, "expansions": row.attempt.expansions, "problem": fields}))
    table = Table(title=f"Kin of published manoeuvres, seed {asked.seed}", title_justify="left")
    for column in ("collection", "vehicle", "solved", "median ms", "99 %"):
        table.add_column(column, no_wrap=True)
    for (form, name), found in rows.items():
        solved, ms = np.array(found).T
        counts = f"{int(solved.sum())} of {len(solved)}"
        table.add_row(form, name, counts, f"{np.median(ms):.0f}", f"{np.quantile(ms, 0.99):.0f}")
    console.print(table)
    for line in unsolved:
        console.print(f"unsolved: {line}")
    if asked.out is not None:
        asked.out.write_text("\n".join(lines) + "\n")
    assert not refused, f"The authority refused {len(refused)} plans; the first: {refused[0]}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="kin", description=__doc__)
    parser.add_argument("--each", type=int, default=1, help="how often each given problem is changed anew")
    parser.add_argument("--seed", type=int, default=7, help="of the problems")
    every = ("tpcap", "bench-mr", "dynobench", "shapes")
    parser.add_argument("--collections", nargs="+", choices=every, default=list(every))
    parser.add_argument("--out", type=Path, help="a row of JSON for each problem")
    return parser


def main(arguments: list[str]) -> None:
    """Read the options and report."""
    report(Console(width=150), _parser().parse_args(arguments))
