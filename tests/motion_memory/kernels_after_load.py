"""Prints each kernel that is compiled or loaded after a memory, for questions of many kinds.

``python -m tests.motion_memory.kernels_after_load FOLDER``
"""

from __future__ import annotations

import gc
import math
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from numba.core.dispatcher import Dispatcher

from motion_memory import load
from planners.maps.questions import question_in
from planners.world.classes.families import families_of, family
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES, problem_class
from planners.world.problem import Arrival, Problem
from planners.world.vehicles.vehicle import Vehicle

SEED = 991


def questions(vehicle: Vehicle) -> Iterator[Problem]:
    """Canonical problems, questions to places and poses, at rest or not, and manoeuvres."""
    for name in CLASSES:
        for difficulty in DIFFICULTIES:
            world = problem_class(name, difficulty, vehicle).draw(SEED, 0)
            yield world
            for number, pose in enumerate((False, True)):
                asked = question_in(world, number, SEED, vehicle, pose)
                if asked is not None:
                    yield asked
                    heading = asked.start[2] if asked.arrival is None else asked.arrival.heading
                    yield replace(asked, arrival=Arrival(heading, 0.3, 0.5, math.inf))
    for name in families_of(vehicle):
        for difficulty in DIFFICULTIES:
            yield family(name, difficulty, vehicle).draw(SEED, 0)


def all_kernels() -> list[Dispatcher]:
    """All kernels that were defined so far; to find them takes as long as to answer a question."""
    return [each for each in gc.get_objects() if isinstance(each, Dispatcher)]


def ready(kernels: list[Dispatcher]) -> Counter[str]:
    """How many versions of each kernel are ready."""
    versions: Counter[str] = Counter()
    for each in kernels:
        versions[f"{each.py_func.__module__}.{each.py_func.__name__}"] += len(each.overloads)
    return versions


if __name__ == "__main__":
    memory = load(sys.argv[1])
    asked = list(questions(memory.vehicle))  # which needs kernels of its own
    kernels = all_kernels()
    before = ready(kernels)
    print(f"{before.total()} kernels")
    for question in asked:
        plan = memory.plan(question).plan
        if plan is not None:
            x, y, *motion = plan.states[len(plan.controls) // 3].tolist()
            beside = replace(question, start=(x + 1e-3, y, motion[0]), start_motion=tuple(motion[1:]))
            memory.plan(beside, current=plan)
        after = ready(kernels)
        if new := after - before:
            print(question.id, *new)
        before = after
    if new := ready(all_kernels()) - before:
        print("defined only then:", *new)
