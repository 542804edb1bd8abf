"""The command ``gather``: ask many general questions, and keep the plans as a library."""

from __future__ import annotations

import math
import multiprocessing
import os
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import count, islice
from multiprocessing.connection import wait
from pathlib import Path
from typing import Final, NamedTuple

from dashboards.cells import CellTable
from planners.maps.questions import question_in
from planners.memory.library.plan_library import gathered_library
from planners.optimisation.polish import polish
from planners.search.manoeuvres.endings import endings_of
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import FAMILIES, family
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import save_library
from storage.exchange.problems import read_problems
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tasks.attempts.judged_attempts import check_plan
from tasks.fan_out.progress import progress
from tasks.settings.checks import check_count, check_outputs
from tasks.settings.errors import RunError, UsageError

COLLECTOR: Final = "lattice"
MARGIN_M: Final = 0.4  # that plans to a place keep from obstacles where there is room, to fit more questions
PIECE: Final = 25  # questions, a second of work
PIECES_AT_ONCE: Final = 8  # that every worker is given before anyone looks how many plans there are
GIVE_UP: Final = 5  # questions asked for each wanted plan
HEADINGS: Final = ("source", "questions", "plans", "driving s")


class Asked(NamedTuple):
    """A question, and the number of the source that it comes from."""

    question: Problem  # in the canonical frame
    source: int


def gather(
    sources: Sequence[str], out: Path, plans: int, poses: float, settings: ImportSettings, workers: int = 1
) -> CellTable:
    """Ask questions of each source in turn until enough are answered, and write the plans as a library.

    A class, a family of manoeuvres and a map give any number of questions, a file of problems those that it
    holds. Each plan is polished and judged. Where the search stands still on its way to a pose, its own plan
    is kept as well: other drives can join it there (``PlanLibrary.endings``), and polish melts such stops.
    The same sources and settings give the same bytes, whatever the number of workers.

    Args:
        sources: names of classes and families; paths of maps, of worlds or of files of problems.
        out: the folder to write.
        plans: how many to keep.
        poses: the share of drawn questions that ask for a pose; the others ask for a place.
        settings: how worlds and maps are read, for which vehicle, and the seed of everything.
        workers: number of worker processes.

    Returns:
        a table that counts questions and plans of each source.

    Raises:
        UsageError: a number is out of range, or ``out`` would be written over a source.
        RunError: too few questions could be answered.
    """
    check_count("plans", plans)
    if not 0.0 <= poses <= 1.0:
        raise UsageError(f"A share of {poses:g} poses: give 0 to 1.")
    check_outputs([Path(each) for each in sources if each not in (*CLASSES, *FAMILIES)], [out])
    streams = [_questions(name, plans, poses, settings) for name in sources]
    asked = islice(_in_turn(streams), GIVE_UP * plans)
    kept: list[tuple[Asked, list[Plan]]] = []
    tried: Counter[int] = Counter()
    answer = partial(_answered, vehicle=settings.vehicle, seed=settings.seed)
    with ExitStack() as stack:
        spread: Callable[..., Iterable[list[list[Plan]]]] = map
        if workers > 1:
            context = multiprocessing.get_context("spawn")
            pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent)
            spread = stack.enter_context(pool).map
        show = stack.enter_context(progress("gather", plans))
        while len(kept) < plans and (some := list(islice(asked, workers * PIECES_AT_ONCE * PIECE))):
            pieces = [some[first : first + PIECE] for first in range(0, len(some), PIECE)]
            for piece, found in zip(pieces, spread(answer, pieces), strict=True):
                for each, variants in zip(piece, found, strict=True):
                    if len(kept) < plans:
                        tried[each.source] += 1
                        kept += [(each, variants)] if variants else []
                show(len(kept))
                if len(kept) == plans:
                    break
    if len(kept) < plans:
        raise RunError(
            f"Only {len(kept)} of the {tried.total()} questions asked were answered, fewer than the "
            f"{plans} plans wanted; ask for fewer plans or give more sources."
        )
    classes = sorted({each.question.class_name for each, _ in kept})
    library = gathered_library(
        classes[0] if len(classes) == 1 else "general",
        settings.vehicle,
        [(each.question.id, plan) for each, variants in kept for plan in variants],
        tuple(sorted({each.question.scale for each, _ in kept})),
    )
    save_library(out, library)
    return _table(sources, tried, kept)


def _end_with_parent() -> None:
    """End this worker as soon as the command that started it is gone, however that was ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # this is a worker

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _in_turn(streams: Sequence[Iterator[Problem]]) -> Iterator[Asked]:
    """The questions of all sources, one of each in turn, until all have ended."""
    left = dict(enumerate(streams))
    while left:
        for source in list(left):
            question = next(left[source], None)
            if question is None:
                del left[source]
            else:
                yield Asked(to_canonical(question)[0], source)


def _questions(name: str, plans: int, poses: float, settings: ImportSettings) -> Iterator[Problem]:
    """The questions of a source; those that are drawn never end."""
    if name in CLASSES and not Path(name).exists():
        return _drawn(name, [], poses, settings)
    if name in FAMILIES and not Path(name).exists():
        drawn = family(name, vehicle=settings.vehicle)
        return (drawn.draw(2 * settings.seed, number) for number in count())
    source = source_at(Path(name))
    if source.format == "problems" and source.path.is_file():
        return iter(read_problems(source.path, settings.vehicle))
    windows = replace(
        settings, count=min(settings.count or plans, plans) if source.is_map else settings.count
    )
    return _drawn(name, import_part(source, "train", windows).problems, poses, settings)


def _drawn(name: str, worlds: Sequence[Problem], poses: float, settings: ImportSettings) -> Iterator[Problem]:
    """Draw one question in each world, again and again; without worlds in fresh ones of the class."""
    drawn = None if worlds else problem_class(name, vehicle=settings.vehicle)
    for number in count():
        world = worlds[number % len(worlds)] if drawn is None else drawn.draw(2 * settings.seed, number)
        pose = math.floor((number + 1) * poses) > math.floor(number * poses)
        question = question_in(world, number, settings.seed, settings.vehicle, pose)
        if question is not None:
            yield question


def _answered(piece: Sequence[Asked], vehicle: Vehicle, seed: int) -> list[list[Plan]]:
    """What is kept for each question: a polished plan, perhaps that of the search, or nothing."""
    workspace = Workspace()
    return [_variants(each.question, vehicle, seed, workspace) for each in piece]


def _variants(question: Problem, vehicle: Vehicle, seed: int, workspace: Workspace) -> list[Plan]:
    attempt = solve(question, COLLECTOR, seed=seed, vehicle=vehicle, workspace=workspace)
    if attempt.plan is None:
        return []
    scene = scene_of(question)
    margin = MARGIN_M if question.arrival is None else 0.0  # a pose may be in a tight slot
    polished = polish(question, attempt.plan, vehicle, scene, workspace, margin_m=margin).plan
    variants = [polished or attempt.plan]
    stops = endings_of([(attempt.plan.states, attempt.plan.controls)], vehicle).follows
    if polished is not None and len(stops) > 1:  # of which the start is one
        variants.append(attempt.plan)
    for plan in variants:
        check_plan(question, plan, COLLECTOR, vehicle)
    return variants


def _table(
    sources: Sequence[str], tried: Counter[int], kept: Sequence[tuple[Asked, list[Plan]]]
) -> CellTable:
    rows = []
    for number, name in enumerate(sources):
        seconds = [variants[0].duration_s for each, variants in kept if each.source == number]
        mean = f"{sum(seconds) / len(seconds):.1f}" if seconds else "-"
        rows.append([[Path(name).name, f"{tried[number]:,}", f"{len(seconds):,}", mean]])
    return CellTable("", HEADINGS, rows)
