"""Side by side: each problem of a range attempted in every way, one after another, and the plans checked."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

from planners.solve import Attempt
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import vehicle_named
from tasks.attempts.attempt_rows import attempt_row, check_attempt
from tasks.attempts.compile_assists import compile_assists
from tasks.attempts.timing import no_garbage_collection
from tasks.fan_out.chunk import Chunk
from tasks.inputs.problem_sources import Generated, Worlds

COLLECTED_EVERY: Final = 10  # problems; collecting garbage takes as long as some ten attempts

Way = TypeVar("Way")


def side_by_side(
    chunk: Chunk,
    source: Generated | Worlds,
    ways: Sequence[Way],
    attempt: Callable[[Problem, Way], Attempt],
    made_by: Callable[[Way], tuple[str | None, str]],
) -> list[dict[str, Any]]:
    """Rows of a chunk's problems to test with: a problem after another, in the order of the ways.

    In which order a problem is attempted is drawn by its id, so that no way always comes first.
    ``made_by``: a way's memory and its run. PlanFaultError: the authority finds fault with a plan.
    """
    vehicle, seed = vehicle_named(chunk.settings.vehicle), chunk.settings.seed
    rows: list[dict[str, Any]] = []
    compile_assists(vehicle)
    for way in ways:  # code and caches are warm before the first time counts
        attempt(source.problem("test", chunk.first), way)
    with no_garbage_collection():
        for index in range(chunk.first, chunk.last):
            problem = source.problem("test", index)
            order = generator(seed, "order", problem.id).permutation(len(ways))
            attempts = {int(i): attempt(problem, ways[i]) for i in order}
            checked: set[bytes] = set()
            for i, way in enumerate(ways):
                check_attempt(problem, attempts[i], checked, vehicle)
                rows.append(attempt_row(attempts[i], *made_by(way), vehicle))
            if index % COLLECTED_EVERY == 0:
                gc.collect()
    return rows
