"""Pieces of gathering: some questions are drawn, answered, polished and judged, and kept in a file."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from planners.memory.plans.experience import Experience
from planners.optimisation.polish import polish
from planners.search.manoeuvres.endings import worth_storing
from planners.search.query import POSE_EXPANSIONS, Limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle, trailers_of
from planners.world.workspace import Workspace
from storage.tables.experiences import experiences_are_done, write_experiences
from storage.vehicles.definitions import definition_of
from storage.worlds.importing import ImportSettings
from tasks.attempts.judged_attempts import check_plan
from tasks.fan_out.keys import digest_of, key_of
from tasks.fan_out.stage import Job
from tasks.requests.part_folder import NumberedPiece
from tasks.requests.question_sources import (
    QuestionSource,
    Share,
    is_data_folder,
    is_drawn,
    named_source,
    question_source,
    turn_of,
)

COLLECTOR: Final = "lattice"
MARGIN_M: Final = 0.4  # that plans to a place keep from obstacles where there is room, to fit more questions
# what is found once is recalled often: in narrow places the search goes on for drives of other kinds
EFFORT: Final = Limits(expansions=POSE_EXPANSIONS + 15_000, seconds=600.0, further=15_000)
PIECE: Final = 10  # numbers of questions: a killed worker loses some three seconds of work
GIVE_UP: Final = 5  # questions asked for each wanted plan


@dataclass(frozen=True)
class GatherRequest:
    """Which questions to ask, and how many answers to keep."""

    sources: tuple[str, ...]  # as they are asked for: names of classes and families, and paths
    out: Path  # the library
    plans: int
    poses: float  # the share of drawn questions that ask for a pose
    difficulty: str  # of classes and families
    settings: ImportSettings
    share: Share = "all"  # which questions of the sources
    learned: Mapping[str, str] = field(default_factory=dict, hash=False)  # data folder: its snapshot's path

    @functools.cached_property
    def asked(self) -> str:
        """A digest of all that a command asks for; whatever was learned in a data folder is the same."""
        settings = self.settings
        how = asdict(settings) | {"vehicle": definition_of(settings.vehicle)}
        contents = ["" if self._is_open(name) else named_source(name).digest() for name in self.sources]
        share = [] if self.share == "all" else [self.share]
        return digest_of(how, self.plans, self.poses, self.difficulty, self.sources, contents, *share)

    def _is_open(self, name: str) -> bool:
        """Whether a source has no contents of its own, or has other ones each day."""
        return is_drawn(name) or name in self.learned or is_data_folder(name)

    @functools.cached_property
    def digest(self) -> str:
        """A digest of all that decides which question has which number, and what is kept of its answer."""
        return key_of("gather", self.asked, dict(self.learned))


@dataclass(frozen=True)
class GatherPiece(NumberedPiece[GatherRequest]):
    """Some consecutive numbers of questions; the sources take turns, number by number."""

    class_name: str = "questions"


class Gathered(NamedTuple):
    """What became of a piece."""

    asked: list[int]  # the numbers that gave a question
    rows: list[int]  # for each plan in the shard the number of its question


def gather_piece(piece: GatherPiece) -> Gathered:
    """Answer the questions of a piece, and write what is kept of the answers.

    Raises JudgementError if the authority refuses a plan.
    """
    request = piece.request
    sources, vehicle, workspace = read_sources(request), request.settings.vehicle, Workspace()
    asked, rows, kept = [], [], []
    for number in range(piece.index * PIECE, (piece.index + 1) * PIECE):
        source, own = turn_of(sources, number)
        drawn = source.question(own)
        if drawn is None:
            continue
        question = to_canonical(drawn)[0]
        asked.append(number)
        plans = stored_variants(question, vehicle, request.settings.seed, workspace, source.known(own))
        rows += [number] * len(plans)
        kept += [Experience(question, plan, vehicle) for plan in plans]
    write_experiences(
        piece.shard,
        kept,
        planners=[COLLECTOR] * len(kept),
        seeds=[request.settings.seed] * len(kept),
        planning_seconds=[0.0] * len(kept),
        key=piece.key,
        vehicle=vehicle,
    )
    return Gathered(asked, rows)


GATHER: Final = Job(
    name="gather",
    do=gather_piece,
    result=Gathered,
    output=lambda piece: piece.shard,
    is_whole=experiences_are_done,
    units=lambda piece: int(min(PIECE, numbers_of(piece.request) - piece.index * PIECE)),
    unit="questions",
)


def gather_pieces(
    request: GatherRequest, do: Callable[[Sequence[GatherPiece]], Sequence[Gathered]]
) -> list[Gathered]:
    """Do as many pieces as it takes to answer enough questions, or to see that it would take too many.

    Args:
        request: which questions to ask, and how many answers to keep.
        do: does pieces and returns their results in order; what is done already need not be done again.

    Returns:
        the results of all pieces from the first on. They do not depend on who does how many at a time.
    """
    longest = numbers_of(request)
    results: list[Gathered] = []
    answered = asked = 0
    most = GIVE_UP * request.plans
    # while there is no room for a question, all that were drawn count
    while (
        answered < request.plans and (asked or len(results) * PIECE) < most and len(results) * PIECE < longest
    ):
        missing = math.ceil(min(request.plans - answered, longest - len(results) * PIECE) / PIECE)
        found = do([GatherPiece(request, len(results) + i) for i in range(missing)])
        answered += sum(len(set(each.rows)) for each in found)
        asked += sum(len(each.asked) for each in found)
        results += found
    return results


def numbers_of(request: GatherRequest) -> float:
    """How many numbers questions have at most, as the sources take turns; no end where they are drawn."""
    return max(source.most for source in read_sources(request)) * len(request.sources)


def read_sources(request: GatherRequest) -> list[QuestionSource]:
    """Read the sources for this process, which keeps what it has read as long as that is the same.

    Raises:
        UsageError: a family is not for the vehicle.
        StorageError: a source cannot be read.
    """
    return _sources(request, request.digest)


@functools.lru_cache(maxsize=1)
def _sources(request: GatherRequest, _digest: str) -> list[QuestionSource]:
    how = (request.plans, request.poses, request.difficulty, request.settings, request.share)
    return [question_source(request.learned.get(name, name), *how) for name in request.sources]


def stored_variants(
    question: Problem, vehicle: Vehicle, seed: int, workspace: Workspace, known: Plan | None = None
) -> list[Plan]:
    """What a library keeps for a question in its own frame: nothing if it is not solved, else a judged plan.

    With it goes the first drive to a pose if it has stops, at which others can join it.

    Args:
        question: the question.
        vehicle: who drives.
        seed: of the search.
        workspace: the buffers of this thread.
        known: a plan that answers the question already. It is kept unless a better one is found.
    """
    ask = partial(solve, question, COLLECTOR, seed=seed, vehicle=vehicle, workspace=workspace)
    found = ask(polished=False).plan
    if found is None:
        variants = [] if known is None else [known]
    elif question.arrival is None:
        best = polish(question, found, vehicle, scene_of(question), workspace, margin_m=MARGIN_M).plan
        variants = worth_storing(found, best, vehicle)
        if known is not None and cost_of(known, vehicle) < cost_of(variants[0], vehicle):
            variants.insert(0, known)  # closer to obstacles: the other fits more questions
    else:  # it may be in a tight slot: no margin
        further = 0 if trailers_of(vehicle) else EFFORT.further  # with trailers an expansion takes longer
        best = ask(limits=replace(EFFORT, further=further)).plan
        if known is not None and (best is None or cost_of(known, vehicle) < cost_of(best, vehicle)):
            best = known
        variants = worth_storing(found, best, vehicle)
    for plan in variants:
        check_plan(question, plan, COLLECTOR, vehicle)
    return variants
