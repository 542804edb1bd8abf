"""Attempts by every way to plan, cold and in turn, kept as rows: one for each better plan that was found."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import pandas as pd
from rich.console import Console

from planners.world.authority.authority import faults
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from tasks.attempts.judged_attempts import PlanFaultError
from tasks.attempts.side_by_side import in_turn
from tasks.fan_out.keys import key_of
from tests.speed.time_to_quality.methods import Found, Method

AT_ONCE: Final = 50  # problems that are attempted in turn, and then kept
REHEARSAL_SECONDS: Final = 0.05


def measured(
    class_name: str,
    problems: Sequence[Problem],
    ways: Sequence[Method],
    vehicle: Vehicle,
    *,
    seconds: float,
    seed: int,
    kept: Path,
    inputs: Sequence[Any],
    console: Console,
) -> pd.DataFrame:
    """What every way found for each problem; batches that a run before has kept are not attempted again.

    Args:
        class_name: how the rows call the problems' class.
        problems: what to attempt.
        ways: ways to plan.
        vehicle: what is driven.
        seconds: how long a way that goes on may take for a problem.
        seed: of the order in which the ways attempt a problem.
        kept: folder of what was measured.
        inputs: JSON values that the rows depend on beside all this, for instance a memory's digest.
        console: where progress is told.

    Returns:
        the columns of ``_rows``.

    Raises:
        PlanFaultError: the authority finds fault with a plan.

    """
    kept.mkdir(parents=True, exist_ok=True)
    names = [way.name for way in ways]
    tables = []
    for first in range(0, len(problems), AT_ONCE):
        batch = problems[first : first + AT_ONCE]
        key = key_of(class_name, [each.id for each in batch], names, seconds, seed, *inputs)
        path = kept / f"{class_name}-{first:05d}-{key}.parquet"
        if not path.is_file():
            began = time.monotonic()
            made = pd.DataFrame(list(_rows(class_name, batch, ways, vehicle, seconds, seed)))
            made.to_parquet(path)
            took = time.monotonic() - began
            console.print(f"{class_name}: {first + len(batch)} of {len(problems)} problems, {took:.0f} s")
        tables.append(pd.read_parquet(path))
    return pd.concat(tables, ignore_index=True)


def _rows(
    class_name: str,
    problems: Sequence[Problem],
    ways: Sequence[Method],
    vehicle: Vehicle,
    seconds: float,
    seed: int,
) -> Iterator[dict[str, Any]]:
    """A row a better plan, and one without driving time for an attempt that found none."""
    for way in ways:
        way.attempt(problems[-1], REHEARSAL_SECONDS)  # compiled or loaded before the first time counts
    found = in_turn(problems, len(ways), seed, lambda problem, way: ways[way].attempt(problem, seconds))
    for (number, who), each in sorted(found.items(), key=lambda item: item[0]):
        problem, way = problems[number], ways[who]
        _judge(problem, way, each, vehicle)
        same = {"class": class_name, "problem": problem.id, "kind": way.kind, "method": way.name}
        better = zip(each.seconds, each.durations, strict=True)
        for moment, duration in better if each.durations else [(each.spent, float("nan"))]:
            yield {**same, "seconds": moment, "duration_s": duration, "spent": each.spent}


def _judge(problem: Problem, way: Method, found: Found, vehicle: Vehicle) -> None:
    wrong = [] if found.plan is None else faults(problem, found.plan, vehicle)
    if wrong:
        raise PlanFaultError(f"{problem.id} solved by {way.name}: {wrong[0]}")
