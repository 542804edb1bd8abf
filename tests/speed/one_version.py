"""Solves the problems of ``two_versions`` with the version of the code that its process finds, one when told.

It is started by its path with another version's folder as ``PYTHONPATH``, so it imports from there alone, and
only what has stood there for long. Each line that it writes is JSON: first a digest of each problem, then for
each line that it reads what came of the next problem. What is asked is ``VEHICLE:KIND:NAME`` as there.
"""

from __future__ import annotations

import gc
import hashlib
import json
import math
import os
import sys
from pathlib import Path

import numpy as np

from planners.maps.questions import question_in
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.compiling import working_clock
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Arrival, Problem, obstacles_of, start_state
from planners.world.vehicles.vehicle import Vehicle, trailers_of
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.vehicles.vehicle_files import said_vehicle

WARM = 6  # problems of another seed that are solved before, so that kernels are loaded


def drawn(kind: str, name: str, vehicle: Vehicle, count: int, seed: int) -> list[Problem]:
    """Problems of a family (its difficulty is the name), or of a class: canonical, to places or to poses.

    Of ``doors`` the name is ``place`` or ``pose``, of ``near`` it is ``open``.
    """
    if kind == "doors":
        rngs = (np.random.default_rng([seed, index]) for index in range(count))
        return [to_canonical(through_doors(rng, vehicle, name == "pose"))[0] for rng in rngs]
    if kind == "near":
        rngs = (np.random.default_rng([seed, index]) for index in range(count))
        return [to_canonical(near_pose(rng, vehicle))[0] for rng in rngs]
    if kind not in ("canonical", "place", "pose"):
        source = family(kind, name, vehicle)
        return [to_canonical(source.draw(seed, index))[0] for index in range(count)]
    problems = [problem_class(name, vehicle=vehicle).draw(seed, index) for index in range(count)]
    if kind == "canonical":
        return problems
    asked = (question_in(each, k, seed, vehicle, pose=kind == "pose") for k, each in enumerate(problems))
    return [to_canonical(question)[0] for question in asked if question is not None]


def through_doors(rng: np.random.Generator, vehicle: Vehicle, pose: bool) -> Problem:
    """From rest through three rooms of 10 x 21 m, by doors 1.3 to 2.2 times as wide as the vehicle."""
    widest = max(body.width for body in (vehicle, *trailers_of(vehicle)))
    walls = []
    for x in (10.0, 20.0):
        wide = rng.uniform(1.3, 2.2) * widest
        low = rng.uniform(1.0, 20.0 - wide)
        for bottom, top in ((0.0, low), (low + wide, 21.0)):
            walls.append([[x - 0.1, bottom], [x + 0.1, bottom], [x + 0.1, top], [x - 0.1, top]])
    for _ in range(6):
        x, y, half = rng.uniform(0.0, 30.0), rng.uniform(0.0, 21.0), rng.uniform(0.3, 0.9)
        if min(abs(x - 10.0), abs(x - 20.0)) > 2.0 + half:
            walls.append(
                [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
            )
    while True:
        start = rng.uniform(1.0, 8.0), rng.uniform(1.0, 20.0), rng.uniform(-math.pi, math.pi)
        goal, heading = (rng.uniform(22.0, 29.0), rng.uniform(1.0, 20.0)), rng.uniform(-math.pi, math.pi)
        problem = Problem(
            *("doors", "doors", start, goal, 0.1 if pose else 0.5, (0.0, 0.0, 30.0, 21.0)),
            obstacles_of([[np.array(wall)] for wall in walls]),
            arrival=Arrival(heading, 0.05, 0.0, 0.0) if pose else None,
        )
        ends = np.stack([start_state(problem, vehicle)] * 2)
        ends[1, :3] = *goal, heading
        if count_free_prefix(ends, vehicle, scene_of(problem)) == len(ends):
            return problem


def near_pose(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """To a pose half a length to six lengths away with nothing around, half of them in motion."""
    length = vehicle.front + vehicle.rear + sum(each.hitch_length for each in trailers_of(vehicle))
    towards, turn = rng.uniform(-math.pi, math.pi, 2)
    metres = rng.uniform(0.5, 6.0) * length
    goal = metres * math.cos(towards), metres * math.sin(towards)
    speed = rng.choice((0.0, 0.0, 0.5, 1.0)) * vehicle.max_speed
    wide = 40.0 * length
    return Problem(
        *("near", "near", (0.0, 0.0, 0.0), goal, 0.05 * length, (-wide, -wide, wide, wide)),
        obstacles_of([]),
        start_motion=(float(speed),),
        arrival=Arrival(float(turn), 0.05, 0.0, 0.0),
    )


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
