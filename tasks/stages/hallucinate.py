"""Hallucinate: for every stored plan many problems that it solves, each with its exact label vector."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from itertools import islice
from typing import Any, Final, NamedTuple

import numpy as np

from planners.memory.hallucination.mixture import LEARNED, hallucinate
from planners.memory.hallucination.no_plan import no_plan
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
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.champion_run import champion_run_of
from tasks.inputs.problem_sources import source_key, source_of
from tasks.inputs.taught_experiences import taught_experiences
from tasks.settings.run_settings import RunSettings
from tasks.stages.keep_experiences import experiences_key

CHUNK_PROBLEMS: Final = 5_000  # some seconds of work
NO_PLAN: Final = "no-plan"
NO_PLAN_SHARE: Final = 0.05  # problems that no plan solves, for each one that is made for a plan
DRAWN: Final = "drawn"
DRAWN_SHARE: Final = 1.0  # problems as the class has them, likewise
ORIGIN: Final = "origin"  # a problem that was collected

Made = tuple[Problem, str]  # a hallucinated problem and its method
Identity = tuple[str, bytes]  # of an experience


class Hallucinated(NamedTuple):
    """What came of a range of plans."""

    problems: int
    taken: int  # plans whose problems the champion's run had made
    plans: int


def hallucinate_chunk(chunk: Chunk) -> Hallucinated:
    """Make problems for a range of experiences, problems that no plan solves, and plain draws of the class.

    The plain draws are what a robot meets: labelled like the others, they teach which plans are free there.
    """
    settings, name = chunk.settings, chunk.class_name
    source = source_of(chunk.data, settings, name)
    experiences = taught_experiences(chunk.run, settings, name)
    sweeps = sweep_plans([experience.plan for experience in experiences], chunk.vehicle)
    mixture = dict(settings.hallucination)
    weights = load_hallucinator(chunk.run.hallucinator(name), chunk.vehicle) if LEARNED in mixture else None
    own = experiences[chunk.first : chunk.last]
    taken = problems_of_champion(chunk, {identity_of(experience) for experience in own})
    made: list[Made] = []
    for experience in own:
        theirs = taken.get(identity_of(experience))
        if theirs is None:
            rng = generator(settings.seed, "hallucinate", name, experience.problem.id)
            around = hallucinate(experience, mixture, source.draw, rng, weights)
            theirs = [(experience.problem, ORIGIN), *islice(around, settings.problems_per_experience - 1)]
        made += theirs
    made_for = np.repeat(np.arange(chunk.first, chunk.last), settings.problems_per_experience)
    share = NO_PLAN_SHARE * settings.problems_per_experience
    first, last = round(share * chunk.first), round(share * chunk.last)
    for index in range(first, max(last, first + 1)):
        rng = generator(settings.seed, NO_PLAN, name, index)
        unsolved = no_plan(sweeps, source.draw, rng, name, index, experiences[0].problem.bounds)
        made.append((unsolved, NO_PLAN))
    wanted = round(DRAWN_SHARE * settings.taught * settings.problems_per_experience)
    drawn = source.count("collect", wanted)  # a folder of worlds has no more than these
    first, last = (drawn * i // settings.taught for i in (chunk.first, chunk.last))
    made += [(source.problem("collect", index), DRAWN) for index in range(first, last)]
    for_none = np.full(len(made) - len(made_for), -1)
    write_labelled(chunk, made, np.concatenate([made_for, for_none]).astype(np.int32), sweeps)
    return Hallucinated(len(made), len(taken), len(own))


def identity_of(experience: Experience) -> Identity:
    """What tells an experience from all others: its problem and its plan."""
    return experience.problem.id, experience.plan.states.tobytes() + experience.plan.controls.tobytes()


def problems_of_champion(chunk: Chunk, wanted: AbstractSet[Identity]) -> dict[Identity, list[Made]]:
    """What the run of the champion has made for some experiences, in its order.

    The same would be made again, since it depends on nothing but experience, settings and code. With learned
    hallucination nothing is taken: its network depends on all experiences.
    """
    champion, name = champion_run_of(chunk), chunk.class_name
    if champion is None or LEARNED in dict(chunk.settings.hallucination):
        return {}
    ours, theirs = chunk.settings, champion.settings
    if _inputs(ours, name) != _inputs(theirs, name):
        return {}
    if name not in ours.classes and ours.wanted != theirs.wanted:
        return {}  # from a map as many problems are cut as are wanted
    try:
        identities = [identity_of(each) for each in taught_experiences(champion.folder, theirs, name)]
        chunks = HALLUCINATE.chunks_of(chunk.data, theirs, name)
    except StorageError:  # the run is not whole any more
        return {}
    made: dict[Identity, list[Made]] = {}
    for each in filter(HALLUCINATE.is_written, chunks):
        if wanted.isdisjoint(identities[each.first : each.last]):
            continue
        shard = each.shard("hallucinated")
        made_for = read_labelled([shard]).plan_index.tolist()
        rows = zip(made_for, read_hallucinated_problems(shard), read_methods(shard), strict=True)
        for plan, problem, method in rows:
            if plan >= 0 and identities[plan] in wanted:
                made.setdefault(identities[plan], []).append((problem, method))
    return made


def write_labelled(chunk: Chunk, made: Sequence[Made], made_for: Integers, sweeps: PlanSweeps) -> None:
    """Write problems with their grids and labels as the shard of a chunk.

    Args:
        chunk: the chunk.
        made: the problems, each with its method.
        made_for: [len(made)] number of the plan that a problem was made for, or -1.
        sweeps: the plans that the labels tell about.

    Raises:
        RuntimeError: a plan does not solve a problem that was made for it.

    """
    problems = [problem for problem, _ in made]
    grids, free = label_problems(problems, sweeps)
    denied = np.flatnonzero((made_for >= 0) & ~free[np.arange(len(problems)), made_for])
    if len(denied):
        raise RuntimeError(f"{problems[denied[0]].id} is not solved by the plan that it was made for")
    write_hallucinated(
        chunk.shard("hallucinated"),
        problems,
        plan_index=made_for,
        methods=[method for _, method in made],
        grids=grids,
        labels=np.packbits(free, axis=1),
        plans=free.shape[1],
        key=chunk.key,
    )


def _inputs(settings: RunSettings, name: str) -> list[Any]:
    """What problems around a plan depend on, besides the experience."""
    made = [settings.seed, settings.problems_per_experience, settings.hallucination]
    return [*made, *source_key(settings, name)]


def plans_at_once(settings: RunSettings) -> int:
    """How many plans a chunk makes problems for."""
    return max(1, CHUNK_PROBLEMS // settings.problems_per_experience)


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    inputs = [*_inputs(settings, name), experiences_key(data, settings, name)]
    return Cut(settings.taught, plans_at_once(settings), inputs)


HALLUCINATE: Final = Stage(
    name="hallucinate",
    do=hallucinate_chunk,
    result=Hallucinated,
    cut=_cut,
    output=lambda chunk: chunk.shard("hallucinated"),
)


def tell_taken(results: Iterable[Hallucinated]) -> None:
    """Say for how many plans the champion's run already had problems, if it had any."""
    results = list(results)
    taken, plans = (sum(each[i] for each in results) for i in (1, 2))
    if taken:
        print(f"hallucinated anew for {plans - taken} of {plans} plans; the champion's run had the others'")
