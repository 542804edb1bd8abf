"""Collect: draw problems of a class, solve them, polish and check the plans: candidates to choose from.

A problem gives several candidates: some are quicker, others fit more problems. Curation chooses among all.
"""

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
GIVE_UP: Final = 20  # problems tried for each wanted experience; a class this hard is no class to remember


class Variant(NamedTuple):
    """How one of the candidates of a problem is made."""

    planner: str | None  # None: the run's collector
    margin_m: float  # of the polished plan


# a quick plan, one that is as good as quick and fits more problems, and one that often takes another way
VARIANTS: Final = (Variant(None, 0.4), Variant(None, 0.8), Variant("follow", 0.8))  # docs/optimisation.md


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
    workspace = Workspace()
    problems = (source.problem("collect", index) for index in range(chunk.first, chunk.last))
    found = [candidates_of(problem, chunk.settings, chunk.vehicle, workspace) for problem in problems]
    made = [each for some in found for each in some]
    write_experiences(
        shard,
        [experience for experience, _ in made],
        planners=[attempt.planner for _, attempt in made],
        seeds=[attempt.seed for _, attempt in made],
        planning_seconds=[attempt.planning_seconds for _, attempt in made],
        key=chunk.key,
        vehicle=chunk.vehicle,
    )
    return Collected(sum(map(bool, found)), tried)


def _variants(settings: RunSettings) -> Sequence[Variant]:
    """The variants that a run makes: only the first where nothing is chosen or plans stay as found."""
    chosen = settings.wanted > settings.experiences and not settings.as_published
    return VARIANTS if chosen else VARIANTS[:1]


def candidates_of(
    problem: Problem, settings: RunSettings, vehicle: Vehicle, workspace: Workspace
) -> list[tuple[Experience, Attempt]]:
    """Solve a problem and make one plan of each variant, or none if the collector finds none."""
    attempts: dict[str, Attempt] = {}
    made: list[tuple[Experience, Attempt]] = []
    for planner, margin_m in _variants(settings):
        name = planner or settings.collector
        if name not in attempts:
            attempts[name] = solve(problem, name, seed=settings.seed, vehicle=vehicle, workspace=workspace)
        attempt = attempts[name]
        if attempt.plan is None:
            if not made:
                break
            continue
        plan = attempt.plan
        if not settings.as_published:
            scene = scene_of(problem)
            plan = polish(problem, plan, vehicle, scene, workspace, margin_m=margin_m).plan or plan
        attempt = replace(attempt, plan=plan, length_m=plan.length_m, duration_s=plan.duration_s)
        check_attempt(problem, attempt, set(), vehicle)
        made.append((Experience(problem, plan, vehicle), attempt))
    return made


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    """As many problems as are needed to solve enough of them, judging by the chunks that are done."""
    source = source_of(data, settings, name)
    size = max(SMALLEST_CHUNK, min(LARGEST_CHUNK, settings.wanted // 10))
    made = [settings.seed, settings.collector, settings.as_published, len(_variants(settings))]
    inputs = [*made, *source_key(settings, name)]
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
