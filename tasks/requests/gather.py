"""The command ``gather``: solve many general questions, and keep the plans as a library."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from statistics import fmean
from typing import Final, NamedTuple

from dashboards.cells import NOTHING, CellTable, decimal
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.memory.plans.experience import Experience
from planners.world.classes.problem_classes import DIFFICULTIES
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.libraries import how_gathered, load_library, save_library
from storage.places.mirror import remove
from storage.tables.experiences import read_experiences
from storage.worlds.importing import ImportSettings
from tasks.fan_out.keys import digest_of
from tasks.inputs.gained_on_the_job import removed_if_it_fails, snapshot_of_questions
from tasks.requests.gather_pieces import (
    GATHER,
    Gathered,
    GatherPiece,
    GatherRequest,
    gather_pieces,
    numbers_of,
)
from tasks.requests.part_folder import (
    do_here,
    part_workers,
    refuse_existing,
    remove_parts,
    unfinished,
)
from tasks.requests.question_sources import Share, holds_its_own, is_data_folder, is_drawn
from tasks.settings.checks import check_count, check_known, check_outputs
from tasks.settings.errors import RunError, UsageError

GatherFlow = Callable[[GatherRequest], list[Gathered]]

_LOG = logging.getLogger(__name__)
USUAL: Final = 1000  # questions to have answered, if no number is given
FEW_PLANS: Final = 50  # gathering so many here takes hardly more time than starting a server and workers
HEADINGS: Final = ("source", "questions asked", "questions answered", "plans stored", "mean driving s")
UNFIT: Final = re.compile(r"[^\w\-. /]")  # in names of MLflow's metrics
FIELDS: Final = ("source", "questions", "answered", "plans", "driving_s")


class SourceCounts(NamedTuple):
    """The results from one source."""

    name: str
    questions: int  # that were asked
    answered: int
    plans: int  # that are stored: of some answers to a pose two
    driving_s: float | None  # mean driving time of the answers, None without any


class Answered(NamedTuple):
    """A question that was answered."""

    source: int  # the number of its source
    variants: list[Experience]  # its plan, polished, and perhaps the first that was found


def gather(
    sources: Sequence[str],
    out: Path,
    plans: int | None,
    poses: float,
    difficulty: str,
    settings: ImportSettings,
    workers: int = 1,
    flow: GatherFlow | None = None,
    share: Share = "all",
) -> list[SourceCounts]:
    """Draw questions from each source in turn until enough are answered, and write the plans as a library.

    A class, a family of manoeuvres and a map give any number of questions, a file of problems and what was
    learned on the job those that they hold.
    Each plan is polished and judged; in a narrow place it is the quickest that a long search finds.
    Where the first drive to a pose stands still on its way, it is kept as well: other drives can join it
    there (``PlanLibrary.endings``), and polish melts such stops.
    The same sources and settings give the same bytes, whatever the number of workers. If the command is
    killed, the same command asks only what is left. Where fewer questions can be answered than wanted, the
    library holds the plans that there are, and a warning says so.

    Args:
        sources: names of classes and families; paths of maps, of worlds, of files of problems, or of data
            folders, for what the vehicle has learned there.
        out: the folder to write, which must not be there.
        plans: how many questions to have answered; None: ``USUAL``, or fewer if the sources hold no more.
        poses: the share of drawn questions that ask for a pose; the others ask for a place.
        difficulty: of classes and families: easy, standard or hard.
        settings: how worlds and maps are read, for which vehicle, and the seed of everything.
        workers: number of worker processes.
        flow: gathers in worker processes. It is called once Prefect's environment is set, so it may import
            Prefect. None does everything in this process.
        share: which questions of the sources.

    Returns:
        what came of each source; of an earlier command that asked for the same, if ``out`` holds its library.

    Raises:
        UsageError: a number is out of range, or ``out`` exists and holds something else.
        StorageError: a source cannot be read.
        RunError: no question could be answered.
    """
    wanted = USUAL if plans is None else plans
    check_asked_questions(wanted, poses, difficulty, sources)
    paths = [Path(each) for each in sources if not is_drawn(each) and not is_data_folder(each)]
    check_outputs(paths, [out])
    for name in sources:
        if is_drawn(name) and Path(name).exists():
            _LOG.warning("%s is taken for the class or family; write ./%s for the folder here.", name, name)
    request = GatherRequest(tuple(sources), out, wanted, poses, difficulty, settings, share)
    asked, gathered = request.asked, how_gathered(out)  # StorageError if a source is missing
    if gathered is not None and gathered["asked"] == asked:
        load_library(out, settings.vehicle)  # StorageError if it is damaged
        _LOG.info("%s holds these plans already; remove it to gather them again.", out)
        counts = [SourceCounts(**each) for each in gathered["sources"]]
    else:
        refuse_existing(out)
        with _with_learned(request) as request, answers_of(request, workers, flow) as (answers, counts):
            library = library_of(settings.vehicle, answers)
            save_library(out, library, {"asked": asked, "sources": [each._asdict() for each in counts]})
    warn_if_short(counts, wanted_plans(plans, sources, counts))
    return counts


def wanted_plans(plans: int | None, sources: Sequence[str], counts: Sequence[SourceCounts]) -> int:
    """How many questions were to be answered, by what ``gather`` was asked for and what came of each source.

    Where no number was given, and all sources hold what they hold, all of that was, up to ``USUAL``.
    """
    if plans is None and all(map(holds_its_own, sources)):
        return min(USUAL, sum(each.questions for each in counts))
    return USUAL if plans is None else plans


@contextmanager
def _with_learned(request: GatherRequest) -> Iterator[GatherRequest]:
    """The request with what was learned until now in the data folders among its sources.

    It stays the same for a command that was killed and is repeated, and is removed at the end of all others.
    """
    name = f"gather-{digest_of(str(request.out.absolute()))[:8]}"
    learned: dict[str, str] = {}
    with ExitStack() as stack:
        for each in filter(is_data_folder, request.sources):
            snapshot = snapshot_of_questions(each, request.settings.vehicle, name)
            stack.enter_context(removed_if_it_fails(snapshot))
            learned[each] = str(snapshot)
        yield replace(request, learned=learned)
        for path in learned.values():
            remove(Path(path))


def warn_if_short(counts: Sequence[SourceCounts], plans: int) -> None:
    """Warn if fewer questions were answered than wanted."""
    answered = sum(each.answered for each in counts)
    if answered < plans:
        _LOG.warning(
            "Questions answered: %d of %d, fewer than the %d plans wanted. The library holds these "
            "plans; give more sources to get more.",
            *(answered, sum(each.questions for each in counts), plans),
        )


def check_asked_questions(plans: int, poses: float, difficulty: str, sources: Sequence[str]) -> None:
    """Check what is asked for; the arguments are those of ``gather``. Raises UsageError if one is wrong."""
    check_count("plans", plans)
    if not 0.0 <= poses <= 1.0:
        raise UsageError(f"--poses is {poses:g}: give a share from 0 to 1.")
    check_known("difficulty", [difficulty], DIFFICULTIES)
    if difficulty != "standard" and not any(map(is_drawn, sources)):
        raise UsageError("--difficulty is of classes and families, and none is among the sources.")


def gathered_table(counts: Sequence[SourceCounts]) -> CellTable:
    """A table that counts questions, answers and plans of each source, with mean driving times."""
    rows = [
        [
            each.name,
            f"{each.questions:,}",
            f"{each.answered:,}",
            f"{each.plans:,}",
            NOTHING if each.driving_s is None else decimal(each.driving_s, 1),
        ]
        for each in counts
    ]
    return CellTable("", HEADINGS, [[row] for row in rows], "gather", FIELDS)


def gathered_metrics(counts: Sequence[SourceCounts]) -> dict[str, float]:
    """The numbers by which libraries are compared."""
    questions, answered, plans = (
        sum(each)
        for each in zip(*((each.questions, each.answered, each.plans) for each in counts), strict=True)
    )
    driving = sum(each.answered * (each.driving_s or 0.0) for each in counts) / answered
    own: Counter[str] = Counter()
    for each in counts:  # of equal names, in a form that MLflow takes
        own["plans_" + UNFIT.sub("_", each.name)] += each.plans
    totals = {"questions": questions, "plans": plans, "answered": answered / questions}
    return {**totals, "driving_seconds": driving, **{name: float(plans) for name, plans in own.items()}}


@contextmanager
def answers_of(
    request: GatherRequest, workers: int, flow: GatherFlow | None
) -> Iterator[tuple[list[Answered], list[SourceCounts]]]:
    """Answer the questions of a request, or those that a killed command has left.

    Args:
        request: the questions.
        workers: number of worker processes.
        flow: gathers in worker processes, as for ``gather``.

    Yields:
        the answers, and what came of each source. The pieces on the disk are removed at the end of the
        context, unless it ends with an error.

    Raises:
        RunError: no question could be answered.
    """
    with unfinished(request.out):
        at_most = min(request.plans, numbers_of(request))  # a wrong source is told before workers start
        if flow is None or workers == 1 or at_most <= FEW_PLANS:
            results = gather_pieces(request, partial(do_here, GATHER))
        else:
            with part_workers(request.out, workers):
                results = flow(request)
        kept, tried = _kept(request, results)
        if not kept:
            none = f"None of the {tried.total()} questions was answered"
            none = none if tried else "There is no room for a question"
            raise RunError(f"{none}; give easier or other sources.")
        yield kept, _counted(request, kept, tried)
        remove_parts(request.out)


def library_of(vehicle: Vehicle, answers: Sequence[Answered]) -> PlanLibrary:
    """The library of some answers."""
    questions = [each.variants[0].problem for each in answers]
    classes = {question.class_name for question in questions}
    return gathered_library(
        classes.pop() if len(classes) == 1 else "general",
        vehicle,
        [(plan.problem.id, plan.plan) for each in answers for plan in each.variants],
        tuple(sorted({question.scale for question in questions})),
    )


def _kept(request: GatherRequest, results: Sequence[Gathered]) -> tuple[list[Answered], Counter[int]]:
    """As many answered questions as are wanted, and how many of each source were asked for them."""
    kept: list[Answered] = []
    tried: Counter[int] = Counter()
    for index, result in enumerate(results):
        if len(kept) == request.plans:
            break
        rows = read_experiences(GatherPiece(request, index).shard, request.settings.vehicle)
        answers = {
            number: [rows[row] for row, _ in group]
            for number, group in groupby(enumerate(result.rows), key=lambda numbered: numbered[1])
        }
        for number in result.asked:
            if len(kept) < request.plans:
                source = number % len(request.sources)
                tried[source] += 1
                kept += [Answered(source, answers[number])] if number in answers else []
    return kept, tried


def _counted(request: GatherRequest, kept: Sequence[Answered], tried: Counter[int]) -> list[SourceCounts]:
    counts = []
    for number, name in enumerate(request.sources):
        own = [each.variants for each in kept if each.source == number]
        driving_s = fmean(best.plan.duration_s for best, *_ in own) if own else None
        plans = sum(map(len, own))
        counts.append(SourceCounts(Path(name).name, tried[number], len(own), plans, driving_s))
    return counts
