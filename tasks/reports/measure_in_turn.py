"""Measure the memories of two runs in turn, in one process, which makes their times comparable."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import pandas as pd

from planners.attempt import WITHOUT_MEMORY
from planners.memory.memory import Memory
from planners.memory.recall import default_recall
from storage.archives.memories import load_memory
from storage.errors import StorageError
from storage.places.run_folder import RunFolder
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.side_by_side import Contestant, MemoryOfRun, side_by_side
from tasks.fan_out.progress import progress
from tasks.inputs.problem_sources import Source, Worlds, source_of
from tasks.settings.checks import check_count
from tasks.settings.run_settings import UNASSISTED, RunSettings

PROBLEMS: Final = 300  # a class
AT_ONCE: Final = 100  # problems that are attempted before one of them is attempted again
ROUNDS: Final = 3  # attempts of each run at a problem; the median counts
FIRST, OTHER = "first", "other"
_SAME: Final = (
    "planner", "problem_class", "problem_id", "assist", "recall", "top_k", "polished", "memory", "run_id",
)  # fmt: skip


class MeasuredRun(NamedTuple):
    """A run whose memories are measured."""

    folder: RunFolder
    settings: RunSettings


def measure_in_turn(
    first: MeasuredRun, other: MeasuredRun, problems: int = PROBLEMS
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Attempt the first run's test problems with the memories of both runs in turn.

    The order at each problem is drawn, every run attempts a problem ``ROUNDS`` times, and the median time
    counts. Controls without memory are attempted separately for each run, which shows whether the measurement
    calls equal things different.

    Args:
        first: the run whose problems are attempted.
        other: the run that it is compared with.
        problems: how many to attempt per class; fewer if the class has fewer.

    Returns:
        the attempt rows of the first run, and those of the other.

    Raises:
        UsageError: there are fewer than 1 problems.
        StorageError: the runs have another vehicle, difficulty or no class and planner in common, or a
            memory is missing.
    """
    check_count("problems", problems)
    classes, planners = _in_common(first.settings, other.settings)
    tables = []
    for name in classes:
        source = _source(first, name)
        memories = {
            (memory, side): _memory(run, memory)
            for side, run in ((FIRST, first), (OTHER, other))
            for memory in _memories(first.settings, other.settings, name)
        }
        everyone = _contestants(first.settings, other.settings, planners, memories)
        count = source.count("test", min(problems, first.settings.test_problems))
        with progress(f"measure {name}", count) as show:
            for start in range(0, count, AT_ONCE):
                end = min(start + AT_ONCE, count)
                asked = [source.problem("test", index) for index in range(start, end)]
                rows = side_by_side(asked, first.settings, everyone * ROUNDS, memories)
                tables.append(pd.DataFrame(rows))
                show(end)
    medians = _medians(pd.concat(tables, ignore_index=True))
    return medians[medians["run_id"] == FIRST], medians[medians["run_id"] == OTHER]


def _in_common(first: RunSettings, other: RunSettings) -> tuple[list[str], list[str]]:
    classes = [name for name in first.class_names if name in other.class_names]
    planners = [planner for planner in first.planners if planner in other.planners]
    for name in ("vehicle", "difficulty"):
        mine, theirs = getattr(first, name), getattr(other, name)
        if mine != theirs:
            raise StorageError(
                f"the runs cannot be measured on the same problems: {name} {mine} and {theirs}"
            )
    if not classes or not planners:
        raise StorageError("the runs have no class or no planner in common: there is nothing to measure")
    return classes, planners


def _source(run: MeasuredRun, name: str) -> Source:
    source = source_of(str(run.folder.path.parents[1]), run.settings, name)
    return replace(source, run=run.folder) if isinstance(source, Worlds) else source


def _memories(first: RunSettings, other: RunSettings, name: str) -> list[str]:
    return [memory for memory in first.memories_of(name) if memory in other.memories_of(name)]


def _memory(run: MeasuredRun, name: str) -> Memory:
    return load_memory(run.folder.memory(name), said_vehicle(run.settings.vehicle))


def _contestants(
    first: RunSettings, other: RunSettings, planners: list[str], memories: dict[MemoryOfRun, Memory]
) -> list[Contestant]:
    """Every planner with every assist that both runs have, with each memory, once for each run."""
    everyone = []
    for planner in planners:
        assists = [each for each in first.assists_of(planner) if each in other.assists]
        for assist in (UNASSISTED, *assists):
            if assist.name in WITHOUT_MEMORY:
                everyone += [Contestant(planner, assist, None, side) for side in (FIRST, OTHER)]
                continue
            for memory, side in memories:
                recall = assist.recall or default_recall(memories[memory, FIRST])
                everyone.append(Contestant(planner, assist._replace(recall=recall), memory, side))
    return everyone


def _medians(rows: pd.DataFrame) -> pd.DataFrame:
    """One row for all rounds, with the median of the planning times."""
    by = rows.groupby(list(_SAME), dropna=False, sort=False)["planning_seconds"]
    return rows.assign(planning_seconds=by.transform("median")).drop_duplicates(list(_SAME))
