"""A challenger: gathered anew, or the champion's plans and those of new questions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean

from planners.memory.library.plan_library import PlanLibrary, gathered_library
from storage.archives.libraries import how_gathered, load_library, save_library
from storage.places.files import remove_folder
from storage.tables.experiences import merge_experiences, read_experiences
from tasks.libraries.pending_library import LibraryRetraining
from tasks.requests.gather import (
    GatherFlow,
    SourceCounts,
    gather,
)
from tasks.requests.question_sources import is_held_back


def gather_anew(
    asked: LibraryRetraining,
    sources: Sequence[str],
    snapshot: Path | None,
    out: Path,
    workers: int,
    flow: GatherFlow | None,
) -> Sequence[SourceCounts]:
    """Gather a library from all sources: as many drawn questions as are asked for, and all learned ones."""
    vehicle = asked.settings.vehicle
    learned = [] if snapshot is None else read_experiences(snapshot, vehicle)
    plans = asked.plans + sum(not is_held_back(each.problem) for each in learned)
    settings = replace(asked.settings, count=asked.plans)  # a map's windows do not depend on what was learned
    return gather(sources, out, plans, asked.poses, asked.difficulty, settings, workers, flow, "train")


def add_learned(
    asked: LibraryRetraining,
    champion: Path,
    snapshot: Path,
    seen: set[str],
    out: Path,
    workers: int,
    flow: GatherFlow | None,
) -> Sequence[SourceCounts]:
    """Write the champion's plans, and those of the learned questions that are in no ``seen`` snapshot."""
    if (kept := how_gathered(out)) is not None:  # by a command that was killed later
        return [SourceCounts(**each) for each in kept["sources"]]
    vehicle = asked.settings.vehicle
    old = load_library(champion, vehicle)
    new_out = out.with_name(f"{out.name}-new")
    learned = read_experiences(snapshot, vehicle)
    rows = [
        row
        for row, each in enumerate(learned)
        if each.problem.id not in seen and not is_held_back(each.problem)
    ]
    new_questions = snapshot.with_name(f"{snapshot.stem}-new.parquet")
    merge_experiences([snapshot], new_questions, rows)
    counts = [
        _counts_of(old),
        *gather(
            *([str(new_questions)], new_out, len(rows), asked.poses, "standard", asked.settings),
            *(workers, flow, "train"),
        ),
    ]
    new = load_library(new_out, vehicle)
    answered = [*zip(old.questions, old.plans, strict=True), *zip(new.questions, new.plans, strict=True)]
    name = old.class_name if old.class_name == new.class_name else "general"
    scales = tuple(sorted({*old.scales, *new.scales}))
    sources = [each._asdict() for each in counts]
    save_library(out, gathered_library(name, vehicle, answered, scales), {"asked": "", "sources": sources})
    remove_folder(new_out)
    return counts


def _counts_of(library: PlanLibrary) -> SourceCounts:
    """What a library holds already, as a row of the table."""
    quickest: dict[str, float] = {}
    for question, plan in zip(library.questions, library.plans, strict=True):
        quickest[question] = min(plan.duration_s, quickest.get(question, math.inf))
    asked = len(quickest)
    return SourceCounts("the champion's", asked, asked, len(library.plans), fmean(quickest.values()))
