"""Memories of 100 chosen plans, what their encoders learn from, and worlds that they never saw."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Final, NamedTuple

import numpy as np

from planners.memory.curation import curate
from planners.memory.hallucination.mixture import hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import PlanSweeps, sweep_plans
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.arrays import Flags, Integers
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.occupancy import Grid
from planners.world.problem import CANONICAL_START, Obstacles, Plan, Problem
from planners.world.randomness import generator
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import Part, source_at
from tests.worlds import SHARED

COLLECTING: Final = 101  # seed of what memories are made of
MEASURING: Final = 102  # seed of the generated problems that they are measured on
CANDIDATES: Final = 1_000  # solved problems, of which a memory's plans are chosen
PLANS: Final = 100
HALLUCINATED: Final = 100  # problems a plan
LIMITS: Final = Limits(expansions=5_000)  # a problem that costs more is not learned from

CLASSES: Final = ("random-hard", "curves-hard", "trap-hard")
CITIES: Final = ("Berlin_0_256", "Denver_1_256", "Moscow_1_256", "NewYork_0_256")
GRIDS: Final = ("forest", "shifting_gaps", "multiple_bugtraps")
POLYGONS: Final = "polygon50"  # its scenes Random and Curves
SCENES: Final = (*GRIDS, POLYGONS)
HELD_OUT: Final = "cities but "  # a memory of three cities, named after the fourth
MEMORIES: Final = (*CLASSES, *(HELD_OUT + city for city in CITIES), *SCENES)


class Lesson(NamedTuple):
    """What the encoder of a memory learns from."""

    plans: list[Plan]  # 100
    grids: Grid  # uint8 [n, 512], packed
    made_for: Integers  # [n] the plan that each was made for, -1 for none
    free: Flags  # [n, 100]


def worlds_for(memory: str) -> list[str]:
    """The worlds that a memory is measured on: no problem of them was collected, and no wall was seen."""
    if memory.startswith(HELD_OUT):
        return [memory.removeprefix(HELD_OUT)]
    return [memory, *CITIES] if memory == CLASSES[0] else [memory]


def problems_of(world: str, count: int, seed: int = MEASURING, part: Part = "test") -> list[Problem]:
    """At most ``count`` canonical problems: drawn with ``seed``, or from a ``part`` of a world or a map."""
    if world in CLASSES:
        name, difficulty = world.split("-")
        source = problem_class(name, difficulty)
        return [source.draw(seed, index) for index in range(count)]
    parts: tuple[Part, ...] = (part,)
    paths = [SHARED / "grid201" / world]
    if world in CITIES:
        paths = [SHARED / "maps" / f"{world}.map"]
    elif world == POLYGONS:
        paths = [SHARED / world / "Random", SHARED / world / "Curves"]
    elif part == "test":
        parts = ("test", "validation")
    found = [
        to_canonical(problem)[0]
        for path in paths
        for each in parts
        for problem in import_part(source_at(path), each, ImportSettings(count=count, seed=seed)).problems
    ]
    return [each for each in found if abs(each.start[2] - CANONICAL_START[2]) <= 1e-9][:count]


def training_problems(memory: str) -> Iterator[Problem]:
    """The problems that a memory is collected from, in turn of its cities."""
    if memory in CLASSES:
        yield from problems_of(memory, 3 * CANDIDATES, COLLECTING)
        return
    if memory in SCENES:
        yield from problems_of(memory, CANDIDATES, COLLECTING, "train")
        return
    cities = [city for city in CITIES if city != memory.removeprefix(HELD_OUT)]
    for each in zip(
        *(problems_of(city, CANDIDATES // 2, COLLECTING, "train") for city in cities), strict=False
    ):
        yield from each


def lesson_of(memory: str) -> Lesson:
    """Collect, choose and hallucinate what the encoder of a memory learns from, as a run does."""
    problems = list(training_problems(memory))
    candidates = list(islice(solved(problems), CANDIDATES))
    kept = [candidates[i] for i in curate(candidates, PLANS)]
    sweeps = sweep_plans([each.plan for each in kept])
    draw = drawer_of(memory, problems)
    made, made_for = hallucinated(memory, kept, sweeps, draw)
    plain = problems[:CANDIDATES] if memory not in CLASSES else drawn_of(memory, len(made))
    grids, free = label_problems(made + plain, sweeps)
    origins = np.array(made_for + [-1] * len(plain), np.int32)
    return Lesson([each.plan for each in kept], grids, origins, free)


def solved(problems: Sequence[Problem]) -> Iterator[Experience]:
    """The problems that Follow solves, with their plans."""
    for problem in problems:
        found = plan("follow", problem, generator(COLLECTING, problem.id), limits=LIMITS).plan
        if found is not None:
            yield Experience(problem, found)


def drawn_of(memory: str, count: int) -> list[Problem]:
    """Ordinary problems of a class that nothing was collected from."""
    return problems_of(memory, count, COLLECTING + 2)


def drawer_of(memory: str, problems: Sequence[Problem]) -> Callable[[np.random.Generator], Obstacles]:
    """What draws the obstacles of other problems of the class, or of the same cities."""
    if memory in CLASSES:
        name, difficulty = memory.split("-")
        return problem_class(name, difficulty).draw_obstacles
    return lambda rng: problems[int(rng.integers(len(problems)))].obstacles


def hallucinated(
    memory: str,
    kept: Sequence[Experience],
    sweeps: PlanSweeps,
    draw: Callable[[np.random.Generator], Obstacles],
    count: int = HALLUCINATED,
) -> tuple[list[Problem], list[int]]:
    """Problems made for each plan, and some that no plan solves; and the plan that each was made for."""
    made: list[Problem] = []
    made_for: list[int] = []
    for i, experience in enumerate(kept):
        rng = generator(COLLECTING, memory, i)
        around = hallucinate(experience, {"rearrange": 1.0}, draw, rng)
        made += [problem for problem, _ in islice(around, count)]
        blocked = count // 20
        made += [no_plan(sweeps, draw, rng, memory, j) for j in range(blocked)]
        made_for += [i] * count + [-1] * blocked
    return made, made_for
