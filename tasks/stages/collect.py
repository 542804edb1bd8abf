"""Collect candidates: draw problems of a class, solve them, polish and check the plans.

Each problem gives several candidates: some are quicker, others fit more problems. Curation chooses among all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from planners.memory.plans.experience import Experience
from planners.optimisation.polish import polish
from planners.solve import solve
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.tables.experiences import SearchedExperience, copy_experiences, write_searched
from storage.tables.shards import shard_is_done
from tasks.attempts.judged_attempts import check_plan
from tasks.fan_out.chunk import Chunk, Cut, chunks_of
from tasks.fan_out.stage import Stage
from tasks.inputs.champion_run import champion_run_of
from tasks.inputs.problem_sources import Source, source_key, source_of
from tasks.settings.run_settings import RunSettings

SMALLEST_CHUNK: Final = 25
LARGEST_CHUNK: Final = 100  # a second of work
PATIENCE: Final = 2  # problems tried for each wanted candidate, once enough to keep are solved
GIVE_UP: Final = 20  # problems tried for each wanted experience; a harder class is not worth remembering


class Variant(NamedTuple):
    """How one candidate of a problem is made."""

    planner: str | None  # None: the run's collector
    margin_m: float  # of the polished plan


# a quick plan, one that is nearly as quick and fits more problems, and one that often takes another path
VARIANTS: Final = (Variant(None, 0.4), Variant(None, 0.8), Variant("follow", 0.8))  # docs/optimisation.md


class Collected(NamedTuple):
    """The results for a range of problems."""

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
    variants = _variants(chunk.settings)
    found = [
        candidates_of(problem, variants, chunk.settings, chunk.vehicle, workspace) for problem in problems
    ]
    write_searched(shard, [each for some in found for each in some], chunk.key, chunk.vehicle)
    return Collected(sum(map(bool, found)), tried)


def _variants(settings: RunSettings) -> Sequence[Variant]:
    """The variants that a run makes: only the first if there is no choice or plans stay as found."""
    chosen = settings.wanted > settings.experiences and not settings.as_published
    return VARIANTS if chosen else VARIANTS[:1]


def candidates_of(
    problem: Problem,
    variants: Sequence[Variant],
    settings: RunSettings,
    vehicle: Vehicle,
    workspace: Workspace,
) -> list[SearchedExperience]:
    """Solve a problem and make one plan of each variant, or none if the first variant's planner fails."""
    searched: dict[str, SearchedExperience | None] = {}
    made: list[SearchedExperience] = []
    for variant in variants:
        name = variant.planner or settings.collector
        if name not in searched:
            attempt = solve(
                problem, name, seed=settings.seed, vehicle=vehicle, workspace=workspace, polished=False
            )
            searched[name] = None
            if attempt.plan is not None:
                searched[name] = SearchedExperience(
                    Experience(problem, attempt.plan, vehicle), name, attempt.seed, attempt.planning_seconds
                )
        found = searched[name]
        if found is not None:
            made.append(candidate_of(found, variant.margin_m, settings, workspace))
        elif not made:
            break
    return made


def candidate_of(
    found: SearchedExperience, margin_m: float, settings: RunSettings, workspace: Workspace
) -> SearchedExperience:
    """Make a candidate of an experience: polish it, and have the authority check it.

    Args:
        found: the experience as a search found it.
        margin_m: the margin of its polished plan, in metres.
        settings: those of the run; with ``as_published``, plans stay as they were found.
        workspace: the caller's buffers.

    Raises:
        PlanFaultError: the plan does not solve the problem.
    """
    problem, plan, vehicle = found.experience.problem, found.experience.plan, found.experience.vehicle
    if not settings.as_published:
        scene = scene_of(problem)
        plan = polish(problem, plan, vehicle, scene, workspace, margin_m=margin_m).plan or plan
    check_plan(problem, plan, f"{found.planner}, seed {found.seed}", vehicle)
    return found._replace(experience=Experience(problem, plan, vehicle))


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    """As many problems as are needed to solve enough of them, judging by the chunks that are done."""
    source = source_of(data, settings, name)
    size = max(SMALLEST_CHUNK, min(LARGEST_CHUNK, settings.wanted // 10))
    made = [settings.seed, settings.collector, settings.as_published, len(_variants(settings))]
    inputs = [*made, *source_key(settings, name)]
    results: list[Collected] = []
    while True:
        cut = Cut(_problems_to_try(settings, source, size, results), size, inputs)
        chunks = chunks_of(COLLECT.name, data, settings, name, cut)[len(results) :]
        kept = [each for each in map(COLLECT.kept, chunks) if each is not None]
        if not chunks or len(kept) < len(chunks):
            return cut
        results += [each.result for each in kept]


def _problems_to_try(settings: RunSettings, source: Source, size: int, results: Sequence[Collected]) -> int:
    """How many problems to try in all, given the results for the first ones.

    A class without enough problems, or with too few that are solved, makes do with fewer.
    """
    solved, tried = (sum(each[i] for each in results) for i in (0, 1))
    enough = solved >= settings.experiences
    missing = settings.wanted - solved
    if missing <= 0 or (enough and tried >= PATIENCE * settings.wanted):
        return tried
    expected = missing * max(tried, 1) // max(solved, 1) + 1 if tried else missing
    more = -(-min(expected, settings.wanted) // size) * size
    until = source.count("collect", tried + more)
    given_up = not enough and tried >= GIVE_UP * settings.experiences + size
    return tried if until <= tried or given_up else until


COLLECT: Final = Stage(
    name="collect",
    do=collect_chunk,
    result=Collected,
    cut=_cut,
    output=lambda chunk: chunk.shard("candidates"),
)
