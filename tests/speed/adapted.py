"""What a memory that was adapted to another vehicle is worth, beside one collected anew in as much CPU time.

``python -m tests.speed adapted [--sources parallel curves …] [--old car] [--new bus.yaml] [--plans 100]
[--questions 60]`` collects plans of the old vehicle, adapts them, and collects plans of the new vehicle, as
``gather`` does, until that took as many CPU seconds as adapting. Then it asks new problems of another seed.
A family of manoeuvres is planned by the lattice alone and with each library; "from memory" is the share that
is answered by a plan of which a part was stored, and driving is of what all solve. For a class it is the
share of problems in which a stored plan is free, and driving that of the quickest one, in problems that all
answer. Intervals are 95 %, by bootstrap. The authority judges every plan.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from time import process_time
from typing import Final

import numpy as np
from rich.console import Console

from planners.memory.adaptation import Adaptation, Outcome
from planners.memory.library.plan_library import gathered_library
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.classes.families import FAMILIES, family
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle
from tasks.requests.gather_pieces import stored_variants
from tests.speed.manoeuvre_attempts import SEED, Peer
from tests.speed.manoeuvres import measured
from tests.speed.statistics import with_interval

COLLECTED: Final = 5  # seed of the old vehicle's plans
ANEW: Final = 6  # seed of the new vehicle's
Answered = list[tuple[str, Plan]]


def _draw(source: str, difficulty: str, vehicle: Vehicle) -> Callable[[int, int], Problem]:
    if source in FAMILIES:
        return family(source, difficulty, vehicle).draw
    return problem_class(source, vehicle=vehicle).draw


def _solved(problem: Problem, vehicle: Vehicle, workspace: Workspace) -> Answered:
    """What ``gather`` keeps for a question."""
    question = to_canonical(problem)[0]
    return [(question.id, plan) for plan in stored_variants(question, vehicle, 1, workspace)]


def measure(console: Console, source: str, asked: argparse.Namespace) -> None:
    """Print what became of one source."""
    old, new = said_vehicle(asked.old), said_vehicle(asked.new)
    workspace, adaptation = Workspace(), Adaptation(old, new)
    draw_old, draw_new = (_draw(source, asked.difficulty, each) for each in (old, new))
    stored: Answered = []
    answered = index = 0
    while answered < asked.plans and index < 3 * asked.plans:
        variants = _solved(draw_old(COLLECTED, index), old, workspace)
        stored += variants
        answered += bool(variants)
        index += 1
    canonical = source in CLASSES
    for question, plan in stored[:3]:
        adaptation.adapted(plan, question, canonical, workspace)  # compiles
    for number in range(2):
        _solved(draw_new(ANEW + 1, number), new, workspace)
    outcomes: Counter[Outcome] = Counter()
    adapted: Answered = []
    began = process_time()
    for question, plan in stored:
        driven = adaptation.adapted(plan, question, canonical, workspace)
        outcomes[driven.outcome] += 1
        adapted += [(question, each) for each in driven.plans]
    spent = process_time() - began
    anew: Answered = []
    tried = 0
    began = process_time()
    while process_time() - began < spent:
        anew += _solved(draw_new(ANEW, tried), new, workspace)
        tried += 1
    counts = ", ".join(f"{count} {each.value}" for each, count in outcomes.items())
    fresh = len({question for question, _ in anew})
    console.print(
        f"{source}, {asked.old} to {new.about.name.decode()}: {len(stored)} plans of {answered} questions"
    )
    console.print(f"  adapted in {spent:.2f} CPU s: {counts}; anew: {fresh} of {tried} questions answered")
    problems = [draw_new(SEED, number) for number in range(asked.questions)]
    answers = _whole if canonical else _joined
    answers(console, problems, {"adapted": adapted, "anew": anew, "both": adapted + anew}, new)


def _whole(
    console: Console, problems: list[Problem], memories: dict[str, Answered], vehicle: Vehicle
) -> None:
    """Coverage and driving times of whole plans in canonical problems."""
    times: dict[str, Floats] = {}
    for name, answered in memories.items():
        sweeps = sweep_plans([plan for _, plan in answered], vehicle)
        seconds = np.array([plan.duration_s for _, plan in answered])
        free = [free_plans(sweeps, scene_of(problem)) for problem in problems]
        times[name] = np.array([seconds[each].min() if each.any() else np.nan for each in free])
    common = np.all([np.isfinite(each) for each in times.values()], axis=0)
    for name, each in times.items():
        covered = with_interval(100.0 * np.isfinite(each), ".0f", np.mean)
        driving = with_interval(each[common], ".1f", np.mean) if common.any() else "-"
        console.print(
            f"  {name:8} {len(memories[name])} plans: free plan in {covered} %, driving {driving} s"
        )


def _joined(
    console: Console, problems: list[Problem], memories: dict[str, Answered], vehicle: Vehicle
) -> None:
    """What the lattice does with each library, and alone."""
    libraries = {
        name: gathered_library("general", vehicle, each, (vehicle.scale,))
        for name, each in memories.items()
        if each
    }
    peers = {"alone": Peer("lattice", False)}
    peers |= {name: Peer("lattice", False, each) for name, each in libraries.items()}
    found = measured(problems, list(peers.values()), vehicle)
    common = np.all([[row.attempt.solved for row in rows] for rows in found.values()], axis=0)
    for name, peer in peers.items():
        rows = found[peer]
        assert not any(row.fault for row in rows)
        stored = np.array([row.attempt.source in ("recalled", "repaired") for row in rows])
        ms = np.array([1e3 * row.attempt.planning_seconds for row in rows])
        driving = np.array([row.attempt.duration_s or np.nan for row in rows])[common]
        console.print(
            f"  {name:8} solved {np.mean([row.attempt.solved for row in rows]):.0%}, from memory "
            f"{with_interval(100.0 * stored, '.0f', np.mean)} %, planning mean "
            f"{with_interval(ms, '.0f', np.mean)} ms, driving {with_interval(driving, '.1f', np.mean)} s"
        )


def report(console: Console, asked: argparse.Namespace | None = None) -> None:
    """Measure and print all sources."""
    asked = asked or _parser().parse_args([])
    for source in asked.sources:
        measure(console, source, asked)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="adapted", description=__doc__)
    parser.add_argument("--sources", nargs="+", choices=[*FAMILIES, *CLASSES], default=["parallel", "curves"])
    parser.add_argument("--difficulty", default="standard", help="of families")
    parser.add_argument("--old", default="car", help="a name or a .yaml file")
    parser.add_argument("--new", default="docs/vehicles/benchmarks/car-larger.yaml", help="the same")
    parser.add_argument("--plans", type=int, default=100, help="questions that the old vehicle has answered")
    parser.add_argument("--questions", type=int, default=60, help="new problems")
    return parser


def main(arguments: list[str]) -> None:
    """Read the options and report."""
    report(Console(width=170), _parser().parse_args(arguments))
