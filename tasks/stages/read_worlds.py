"""Read the worlds and maps of a run and bring them into the canonical frame, once."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from planners.world.alignment import to_canonical
from planners.world.problem import Problem, is_canonical
from storage.tables.imported_problems import write_imported
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import Part, source_at
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage, is_marked, mark_done
from tasks.inputs.problem_sources import PARTS, source_key
from tasks.inputs.skipped_worlds import summed_up
from tasks.settings.errors import RunError
from tasks.settings.run_settings import world_class

# problems to collect from for each wanted solved problem, because some are not solved
CUT_FROM_MAP: Final = 2
OTHER_QUESTION: Final = (
    "does not lead from rest to a place 50√2 m straight ahead (times the scale), which is what a run collects"
)

_LOG = logging.getLogger(__name__)


class WorldsRead(NamedTuple):
    """The result of reading a folder of worlds or a map."""

    skipped: list[tuple[str, str]]  # worlds that were left out, and why
    unusable: str | None = None  # why the class has no problems, if it has none


def read_worlds_chunk(chunk: Chunk) -> WorldsRead:
    """Read the worlds of a class, or cut its map into problems.

    If a part has no usable problem, the class has none. Raises RunError in that case if settings are strict,
    or if a problem asks another question than runs collect.
    """
    settings, run = chunk.settings, chunk.run
    source = source_at(next(Path(path) for path in settings.worlds if world_class(path) == chunk.class_name))
    counts = {"collect": CUT_FROM_MAP * settings.wanted, "test": settings.test_problems}
    skipped: list[tuple[str, str]] = []
    unusable: str | None = None
    problems: dict[Part, list[Problem]] = {}
    whole = (chunk.vehicle, settings.strict)
    for purpose, part in PARTS.items():
        count = counts[purpose] if source.is_map else None
        imported = import_part(
            source, part, ImportSettings(*whole, count, settings.seed, chunk.vehicle.scale)
        )
        problems[part] = []
        for problem in imported.problems:
            fit = replace(to_canonical(problem)[0], class_name=chunk.class_name)
            if is_canonical(fit):
                problems[part].append(fit)
            elif settings.strict:
                raise RunError(f"{source.path}: problem {problem.id} {OTHER_QUESTION}.")
            else:
                imported.skipped.append((f"{source.path} problem {problem.id}", OTHER_QUESTION))
        if not problems[part]:
            unusable = f"{source.path} holds no usable problem for part {part} ({imported.explained()})."
            if settings.strict:
                raise RunError(unusable)
        skipped += imported.skipped
    for part in PARTS.values():
        write_imported(run.worlds(chunk.class_name, part), [] if unusable else problems[part])
    mark_done(run.worlds_folder(chunk.class_name), chunk.key)
    return WorldsRead(skipped, unusable)


READ_WORLDS: Final = Stage(
    name="read worlds",
    do=read_worlds_chunk,
    result=WorldsRead,
    classes=lambda settings: [world_class(path) for path in settings.worlds],
    cut=lambda _, settings, name: Cut(1, 1, [*source_key(settings, name), settings.strict]),
    output=lambda chunk: chunk.run.worlds_folder(chunk.class_name),
    is_whole=is_marked,
)


def log_skipped(results: Iterable[WorldsRead]) -> None:
    """Log warnings about skipped worlds, summarised by reason, and about classes without any."""
    results = list(results)
    skipped = [(world, reason) for result in results for world, reason in result.skipped]
    if skipped:
        _LOG.warning(summed_up(skipped))
    for result in results:
        if result.unusable:
            _LOG.warning(result.unusable)
