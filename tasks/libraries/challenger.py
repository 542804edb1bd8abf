"""A challenger: the champion's plans or new ones of all sources, and those of what was learned since."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import Final

from planners.memory.library.plan_library import PlanLibrary, gathered_library
from storage.archives.libraries import how_gathered, load_library, save_library
from storage.places.mirror import remove
from storage.tables.experiences import merge_experiences, read_experiences
from tasks.libraries.pending_library import LibraryRetraining
from tasks.requests.gather import (
    GatherFlow,
    SourceCounts,
    answers_of,
    library_of,
    warn_if_short,
)
from tasks.requests.question_sources import holds_its_own, is_held_back
from tasks.settings.errors import RunError

LEARNED: Final = "learned"  # the name of a source


def make_challenger(
    asked: LibraryRetraining,
    champion: Path | None,
    learned: Path | None,
    out: Path,
    workers: int,
    flow: GatherFlow | None,
) -> list[SourceCounts]:
    """Write a library: the plans to begin with, and those of learned questions that these do not answer.

    If the command is killed, the same command asks only what is left.

    Args:
        asked: which library, and how.
        champion: the library to begin with; None gathers from the sources.
        learned: the file of what was learned until now; None if there is nothing.
        out: the folder to write.
        workers: number of worker processes.
        flow: gathers in worker processes, as for ``gather``.

    Returns:
        what came of each source; nothing, and nothing is written, if the champion has all there is.

    Raises:
        RunError: no question could be answered, or all are held back to judge by.
        StorageError: a source, the champion, or what an earlier command wrote to ``out`` cannot be read.
    """
    vehicle = asked.settings.vehicle
    if (kept := how_gathered(out)) is not None:  # by a command that was killed later
        load_library(out, vehicle)
        return [SourceCounts(**each) for each in kept["sources"]]
    old = None if champion is None else load_library(champion, vehicle)
    known = set() if old is None else set(old.questions)
    questions = [] if learned is None else [each.problem for each in read_experiences(learned, vehicle)]
    rows = [row for row, each in enumerate(questions) if each.id not in known and not is_held_back(each)]
    if old is None and not asked.sources and not rows:
        raise RunError(
            f"{asked.name}: all {len(questions)} learned questions are held back to judge by; solve more "
            "with --learn, or name a class, a family, a map or worlds."
        )
    libraries, counts = ([], []) if old is None else ([old], [_counts_of(old)])
    new = out.with_name(f"{out.name}-new.parquet")
    with ExitStack() as stack:
        if old is None and asked.sources:
            drawn, of_sources = stack.enter_context(answers_of(asked.request(out), workers, flow))
            warn_if_short(of_sources, _wanted(asked, of_sources))
            libraries.append(library_of(vehicle, drawn))
            counts += of_sources
        if learned is not None and rows:
            merge_experiences([learned], new, rows)
            place = out.with_name(f"{out.name}-learned")
            request = replace(
                asked.request(place), sources=(LEARNED,), plans=len(rows), learned={LEARNED: str(new)}
            )
            answers, of_learned = stack.enter_context(answers_of(request, workers, flow))
            libraries.append(library_of(vehicle, answers))
            counts += of_learned
        if old is None or rows:
            how = {"asked": "", "sources": [each._asdict() for each in counts]}
            save_library(out, _joined(libraries), how)
    remove(new)
    return counts if old is None or rows else []


def are_plans_missing(asked: LibraryRetraining, counts: Sequence[SourceCounts]) -> bool:
    """Whether the sources gave fewer plans than were asked for.

    Args:
        asked: which library, and how.
        counts: what came of each source, in their order, and then of what was learned.
    """
    of_sources = counts[: len(asked.sources)]
    return sum(each.answered for each in of_sources) < _wanted(asked, of_sources)


def _wanted(asked: LibraryRetraining, of_sources: Sequence[SourceCounts]) -> int:
    """How many plans are wanted of the sources: no more than files of problems hold."""
    if all(map(holds_its_own, asked.sources)):
        return min(asked.plans, sum(each.questions for each in of_sources))
    return asked.plans


def _joined(libraries: Sequence[PlanLibrary]) -> PlanLibrary:
    """The plans of all of some libraries."""
    names = {each.class_name for each in libraries}
    return gathered_library(
        names.pop() if len(names) == 1 else "general",
        libraries[0].vehicle,
        [pair for each in libraries for pair in zip(each.questions, each.plans, strict=True)],
        tuple(sorted({scale for each in libraries for scale in each.scales})),
    )


def _counts_of(library: PlanLibrary) -> SourceCounts:
    """What a library holds already, as a row of the table."""
    quickest: dict[str, float] = {}
    for question, plan in zip(library.questions, library.plans, strict=True):
        quickest[question] = min(plan.duration_s, quickest.get(question, math.inf))
    asked = len(quickest)
    return SourceCounts("champion", asked, asked, len(library.plans), fmean(quickest.values()))
