"""Collect: draw problems of a class, solve them, polish and check the plans: candidates to choose from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

from planners.memory.plans.experience import Experience
from planners.optimisation.polish import polish
from planners.solve import Attempt, solve
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.tables.experiences import copy_experiences, write_experiences
from storage.tables.shards import shard_is_done
from tasks.attempts.judged_attempts import check_attempt
from tasks.fan_out.chunk import Chunk, Cut, chunks_of
from tasks.fan_out.stage import Stage
from tasks.inputs.champion_run import champion_run_of
from tasks.inputs.problem_sources import Source, source_key, source_of
from tasks.settings.errors import RunError
from tasks.settings.run_settings import RunSettings

SMALLEST_CHUNK: Final = 25
LARGEST_CHUNK: Final = 100  # a second of work
PATIENCE: Final = 2  # problems tried for each wanted candidate, once as many are solved as must be kept
MARGIN_M: Final = 0.4  # of polished plans: tighter ones fit fewer problems (docs/optimisation.md)
GIVE_UP: Final = 20  # problems tried for each wanted experience; a class this hard is no class to remember


class Collected(NamedTuple):
    """What came of a range of problems."""

    solved: int
    tried: int


def collect_chunk(chunk: Chunk) -> Collected:
    """Solve a range of a class's problems; write those that are solved, each plan checked by the authority.

    In a retraining a shard that the champion's run has made from the same key is copied.
    """
    shard, tried = chunk.shard("candidates"), chunk.last - chunk.first
    champion = champion_run_of(chunk)
    if champion is not None:
        theirs = champion.folder.shard("candidates", chunk.class_name, chunk.index)
        if shard_is_done(theirs, chunk.key):
            return Collected(copy_experiences(theirs, shard, chunk.key), tried)
    source = source_of(chunk.data, chunk.settings, chunk.class_name)
    planner, seed, vehicle = chunk.settings.collector, chunk.settings.seed, chunk.vehicle
    workspace = Workspace()
    experiences, seconds = [], []
    for index in range(chunk.first, chunk.last):
        problem = source.problem("collect", index)
        attempt = solve(problem, planner, seed=seed, vehicle=vehicle, workspace=workspace)
        if not chunk.settings.as_published:
            attempt = _polished(problem, attempt, vehicle, workspace)
        if attempt.plan is not None:
            check_attempt(problem, attempt, set(), vehicle)
            experiences.append(Experience(problem, attempt.plan, vehicle))
            seconds.append(attempt.planning_seconds)
    write_experiences(
        shard,
        experiences,
        planner=planner,
        seeds=[seed] * len(experiences),
        planning_seconds=seconds,
        key=chunk.key,
        vehicle=vehicle,
    )
    return Collected(len(experiences), tried)


def _polished(problem: Problem, attempt: Attempt, vehicle: Vehicle, workspace: Workspace) -> Attempt:
    """The attempt with its plan, if it has one, as quick as small changes make it."""
    if attempt.plan is None:
        return attempt
    plan = polish(problem, attempt.plan, vehicle, scene_of(problem), workspace, margin_m=MARGIN_M).plan
    return (
        attempt
        if plan is None
        else replace(attempt, plan=plan, length_m=plan.length_m, duration_s=plan.duration_s)
    )


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    """As many problems as are needed to solve enough of them, judging by the chunks that are done."""
    source = source_of(data, settings, name)
    size = max(SMALLEST_CHUNK, min(LARGEST_CHUNK, settings.wanted // 10))
    inputs = [settings.seed, settings.collector, settings.as_published, *source_key(settings, name)]
    results: list[Collected] = []
    while True:
        cut = Cut(_problems_to_try(settings, name, source, size, results), size, inputs)
        chunks = chunks_of(COLLECT.name, data, settings, name, cut)[len(results) :]
        kept = [each for each in map(COLLECT.kept, chunks) if each is not None]
        if not chunks or len(kept) < len(chunks):
            return cut
        results += [each.result for each in kept]


def _problems_to_try(
    settings: RunSettings, name: str, source: Source, size: int, results: Sequence[Collected]
) -> int:
    """How many problems to try in all, given what came of the first ones.

    A class without enough problems, or with too few that are solved, makes do with fewer candidates if they
    suffice for its experiences. RunError if they do not.
    """
    solved, tried = (sum(each[i] for each in results) for i in (0, 1))
    enough = solved >= settings.experiences
    missing = settings.wanted - solved
    if missing <= 0 or (enough and tried >= PATIENCE * settings.wanted):
        return tried
    expected = missing * max(tried, 1) // max(solved, 1) + 1 if tried else missing
    more = -(-min(expected, settings.wanted) // size) * size
    until = source.count("collect", tried + more)
    if enough and until <= tried:
        return tried
    if until <= tried or tried >= GIVE_UP * settings.experiences + size:
        raise RunError(
            f"Class {name}: {solved} of {tried} problems solved, {settings.experiences} are wanted; "
            "ask for fewer, or take easier problems."
        )
    return until


COLLECT: Final = Stage(
    name="collect",
    do=collect_chunk,
    result=Collected,
    cut=_cut,
    output=lambda chunk: chunk.shard("candidates"),
)
