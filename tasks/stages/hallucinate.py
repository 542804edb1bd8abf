"""Hallucinate: make many problems that each stored plan solves, with their exact label vectors."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import islice
from typing import Any, Final, NamedTuple

import numpy as np

from planners.memory.hallucination.mixture import LEARNED, hallucinate
from planners.memory.hallucination.no_plan import NeverBlockedError, no_plan
from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import PlanSweeps, sweep_plans
from planners.world.arrays import Integers
from planners.world.problem import Problem
from planners.world.randomness import generator
from storage.archives.hallucinators import load_hallucinator
from storage.errors import StorageError
from storage.tables.hallucinated import (
    read_hallucinated_problems,
    read_labelled,
    read_methods,
    write_hallucinated,
)
from tasks.fan_out.chunk import Chunk, Cut, run_folder
from tasks.fan_out.stage import Stage
from tasks.inputs.champion_run import champion_run_of
from tasks.inputs.problem_sources import Source, source_key, source_of
from tasks.inputs.taught_experiences import taught_counts, taught_experiences
from tasks.settings.run_settings import RunSettings
from tasks.stages.keep_experiences import experiences_key

CHUNK_PROBLEMS: Final = 5_000  # a few seconds of work
NO_PLAN: Final = "no-plan"
NO_PLAN_SHARE: Final = 0.05  # problems that no plan solves, for each one that is made for a plan
DRAWN: Final = "drawn"
DRAWN_SHARE: Final = 1.0  # problems drawn from the class as it is, likewise
ORIGIN: Final = "origin"  # a problem that was collected

MadeProblem = tuple[Problem, str]  # a problem, and the method that made it
Identity = tuple[str, bytes]  # of an experience: id of the problem, states and controls of the plan

_LOG = logging.getLogger(__name__)


class Hallucinated(NamedTuple):
    """How many problems were made for a range of plans."""

    problems: int
    copied_plans: int  # plans whose problems were copied from the champion's run
    plans: int
    unsolved: int  # problems that no plan solves: none if the class never blocks some plan


def hallucinate_chunk(chunk: Chunk) -> Hallucinated:
    """Make problems for a range of experiences, problems that no plan solves, and ordinary ones of the class.

    Ordinary problems are like those that a robot meets. They are labelled like the others, so the encoder
    learns from them which plans are free there. The paper's method makes only the first kind.
    """
    settings, name = chunk.settings, chunk.class_name
    source = source_of(chunk.data, settings, name)
    experiences = taught_experiences(chunk.run, settings, name)
    sweeps = sweep_plans([experience.plan for experience in experiences], chunk.vehicle)
    mixture = dict(settings.hallucination)
    weights = load_hallucinator(chunk.run.hallucinator(name), chunk.vehicle) if LEARNED in mixture else None
    chunk_experiences = experiences[chunk.first : chunk.last]
    copied = problems_of_champion(chunk, {identity_of(experience) for experience in chunk_experiences})
    problems: list[MadeProblem] = []
    for experience in chunk_experiences:
        around_plan = copied.get(identity_of(experience))
        if around_plan is None:
            rng = generator(settings.seed, "hallucinate", name, experience.problem.id)
            hallucinated = hallucinate(experience, mixture, source.draw, rng, weights)
            around_plan = [
                (experience.problem, ORIGIN),
                *islice(hallucinated, settings.problems_per_experience - 1),
            ]
        problems += around_plan
    made_for = np.repeat(np.arange(chunk.first, chunk.last), settings.problems_per_experience)
    if not settings.as_published:
        problems += problems_for_none(chunk, source, sweeps, experiences[0].problem)
    for_none = np.full(len(problems) - len(made_for), -1)
    write_labelled(chunk, problems, np.concatenate([made_for, for_none]).astype(np.int32), sweeps)
    unsolved = sum(method == NO_PLAN for _, method in problems)
    return Hallucinated(len(problems), len(copied), len(chunk_experiences), unsolved)


def problems_for_none(chunk: Chunk, source: Source, sweeps: PlanSweeps, like: Problem) -> list[MadeProblem]:
    """A chunk's share of the problems that no plan solves, and of ordinary problems of the class.

    Args:
        chunk: the chunk.
        source: of problems of the class.
        sweeps: the plans that are taught.
        like: a problem with the bounds and the scale that they are to have.
    """
    settings, name = chunk.settings, chunk.class_name
    problems: list[MadeProblem] = []
    share = NO_PLAN_SHARE * settings.problems_per_experience
    first, last = round(share * chunk.first), round(share * chunk.last)
    for index in range(first, max(last, first + 1)):
        rng = generator(settings.seed, NO_PLAN, name, index)
        try:
            made = no_plan(sweeps, source.draw, rng, name, index, like.bounds, like.scale)
            problems.append((made, NO_PLAN))
        except NeverBlockedError:  # then there is no such problem to learn from
            break
    wanted = round(DRAWN_SHARE * settings.taught * settings.problems_per_experience)
    drawn = source.count("collect", wanted)  # a folder of worlds has no more than these
    first, last = (drawn * i // settings.taught for i in (chunk.first, chunk.last))
    return problems + [(source.problem("collect", index), DRAWN) for index in range(first, last)]


def identity_of(experience: Experience) -> Identity:
    """The identity of an experience: its problem and its plan."""
    return experience.problem.id, experience.plan.states.tobytes() + experience.plan.controls.tobytes()


def problems_of_champion(chunk: Chunk, wanted: AbstractSet[Identity]) -> dict[Identity, list[MadeProblem]]:
    """The problems that the champion's run has made for some experiences, in its order.

    The same problems would be made again, since they depend only on the experience, the settings and the
    code. With learned hallucination the dict is empty, because the network depends on all experiences.

    Args:
        chunk: the chunk that needs the problems.
        wanted: the identities of its experiences.

    Returns:
        the problems of each experience that the champion's run has too.
    """
    champion, name = champion_run_of(chunk), chunk.class_name
    if champion is None or LEARNED in dict(chunk.settings.hallucination):
        return {}
    settings, old_settings = chunk.settings, champion.settings
    if _inputs(settings, name) != _inputs(old_settings, name):
        return {}
    if name not in settings.classes and settings.wanted != old_settings.wanted:
        return {}  # the problems that are cut from a map depend on their number
    try:
        old_experiences = taught_experiences(champion.folder, old_settings, name)
        old_chunks = HALLUCINATE.chunks_of(chunk.data, old_settings, name)
    except StorageError:  # files of the run are missing
        return {}
    identities = [identity_of(experience) for experience in old_experiences]
    problems: dict[Identity, list[MadeProblem]] = {}
    for old_chunk in filter(HALLUCINATE.is_written, old_chunks):
        if wanted.isdisjoint(identities[old_chunk.first : old_chunk.last]):
            continue
        shard = old_chunk.shard("hallucinated")
        made_for = read_labelled([shard]).plan_index.tolist()
        rows = zip(made_for, read_hallucinated_problems(shard), read_methods(shard), strict=True)
        for plan, problem, method in rows:
            if plan >= 0 and identities[plan] in wanted:
                problems.setdefault(identities[plan], []).append((problem, method))
    return problems


def write_labelled(
    chunk: Chunk, made_problems: Sequence[MadeProblem], made_for: Integers, sweeps: PlanSweeps
) -> None:
    """Write problems with their grids and labels as the shard of a chunk.

    Args:
        chunk: the chunk.
        made_problems: the problems, each with its method.
        made_for: [problems] number of the plan that each problem was made for, or -1.
        sweeps: the plans that the labels are about.

    Raises:
        RuntimeError: a plan does not solve a problem that was made for it.
    """
    problems = [problem for problem, _ in made_problems]
    grids, free = label_problems(problems, sweeps)
    unsolved = np.flatnonzero((made_for >= 0) & ~free[np.arange(len(problems)), made_for])
    if len(unsolved):
        raise RuntimeError(f"{problems[unsolved[0]].id} is not solved by the plan that it was made for")
    write_hallucinated(
        chunk.shard("hallucinated"),
        problems,
        plan_index=made_for,
        methods=[method for _, method in made_problems],
        grids=grids,
        labels=np.packbits(free, axis=1),
        plans=free.shape[1],
        key=chunk.key,
    )


def _inputs(settings: RunSettings, name: str) -> list[Any]:
    """Everything that the problems around a plan depend on, besides the experience."""
    hallucination = [settings.seed, settings.problems_per_experience, settings.hallucination]
    return [*hallucination, *source_key(settings, name)]


def plans_at_once(settings: RunSettings) -> int:
    """How many plans a chunk makes problems for."""
    return max(1, CHUNK_PROBLEMS // settings.problems_per_experience)


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    inputs = [*_inputs(settings, name), settings.as_published, experiences_key(data, settings, name)]
    (taught,) = taught_counts(run_folder(data, settings), settings, name)
    return Cut(taught, plans_at_once(settings), inputs)


HALLUCINATE: Final = Stage(
    name="hallucinate",
    do=hallucinate_chunk,
    result=Hallucinated,
    cut=_cut,
    output=lambda chunk: chunk.shard("hallucinated"),
)


def log_copied(results: Iterable[Hallucinated]) -> None:
    """Log for how many plans problems were copied from the champion's run, if there are any."""
    results = list(results)
    copied = sum(result.copied_plans for result in results)
    plans = sum(result.plans for result in results)
    if copied:
        _LOG.info(
            "made new problems for %d of %d plans; those of the others were copied from the champion's run",
            plans - copied,
            plans,
        )


def warn_of_easy_classes(results: Mapping[Chunk, Hallucinated]) -> None:
    """Warn of classes whose obstacles never block some plan, so that their memory always recalls one."""
    for name in dict.fromkeys(chunk.class_name for chunk in results):
        own = [(chunk, made) for chunk, made in results.items() if chunk.class_name == name]
        if not any(made.unsolved or chunk.settings.as_published for chunk, made in own):
            _LOG.warning(
                "Class %s is easy: its obstacles never block some of its plans. Its memory learns from no "
                "problem without a plan, and always recalls one.",
                name,
            )
