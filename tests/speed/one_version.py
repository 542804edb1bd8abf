"""Solves the problems of ``two_versions`` with the version of the code that its process finds, one when told.

It is started by its path with another version's folder as ``PYTHONPATH``, so it imports from there alone, and
only what has stood there for long. Each line that it writes is JSON: first a digest of each problem, then for
each line that it reads what came of the next problem. What is asked is ``VEHICLE:KIND:NAME`` as there.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import sys
from pathlib import Path

from planners.maps.questions import question_in
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.compiling import working_clock
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.vehicles.vehicle_files import said_vehicle

WARM = 6  # problems of another seed that are solved before, so that kernels are loaded


def drawn(kind: str, name: str, vehicle: Vehicle, count: int, seed: int) -> list[Problem]:
    """Problems of a family (its difficulty is the name), or of a class: canonical, to places or to poses."""
    if kind not in ("canonical", "place", "pose"):
        source = family(kind, name, vehicle)
        return [to_canonical(source.draw(seed, index))[0] for index in range(count)]
    problems = [problem_class(name, vehicle=vehicle).draw(seed, index) for index in range(count)]
    if kind == "canonical":
        return problems
    asked = (question_in(each, k, seed, vehicle, pose=kind == "pose") for k, each in enumerate(problems))
    return [to_canonical(question)[0] for question in asked if question is not None]


def digest_of(problem: Problem) -> str:
    """What tells whether two versions draw the same problem."""
    asked = problem.start, problem.goal, problem.goal_radius, problem.arrival
    numbers = problem.obstacles.vertices.round(9) + 0.0
    return hashlib.sha256(numbers.tobytes() + repr(asked).encode()).hexdigest()


def main(asked: list[str]) -> None:
    """Answer from standard input, on one core."""
    what, count, seed, core, library = asked
    os.sched_setaffinity(0, {int(core)})
    said, kind, name = what.rsplit(":", 2)
    vehicle, workspace = said_vehicle(said), Workspace()
    memory = load_library(Path(library), vehicle) if library else None
    help_of = {"assist": "join", "memory": memory} if memory is not None else {}
    problems = drawn(kind, name, vehicle, int(count), int(seed))
    for problem in drawn(kind, name, vehicle, WARM, int(seed) + 1):
        solve(problem, "lattice", vehicle=vehicle, workspace=workspace, **help_of)
    gc.freeze()
    gc.disable()
    print(json.dumps([digest_of(problem) for problem in problems]), flush=True)
    for problem in problems:
        if not sys.stdin.readline():
            return
        began = working_clock()
        attempt = solve(problem, "lattice", vehicle=vehicle, workspace=workspace, **help_of)
        took = working_clock() - began
        wrong = [] if attempt.plan is None else faults(problem, attempt.plan, vehicle)
        print(json.dumps([took, attempt.duration_s, bool(wrong)]), flush=True)
        gc.collect()


if __name__ == "__main__":
    main(sys.argv[1:])
