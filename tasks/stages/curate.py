"""Curate: choose the N solved problems of a class that are most useful to remember."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Final

from planners.memory.curation import curate
from planners.memory.plans.experience import Experience
from storage.tables.experiences import merge_experiences, read_experiences
from storage.vehicles.vehicle_files import said_vehicle
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import COLLECT
from tasks.stages.collect_gained import COLLECT_GAINED


def curate_chunk(chunk: Chunk) -> None:
    """Choose among the candidates of a class, which are in shards ``first`` to ``last - 1``."""
    run, settings, name = chunk.run, chunk.settings, chunk.class_name
    shards = [run.shard("candidates", name, i) for i in range(chunk.first, chunk.last)]
    drawn = [each for shard in shards for each in read_experiences(shard, chunk.vehicle)]
    gained_shards = [*map(COLLECT_GAINED.output, COLLECT_GAINED.chunks_of(chunk.data, settings, name))]
    gained = [each for shard in gained_shards for each in read_experiences(shard, chunk.vehicle)]
    shards += gained_shards
    merge_experiences(shards, chunk.shard("curated"), chosen(drawn, gained, settings), chunk.key)


def chosen(drawn: Sequence[Experience], gained: Sequence[Experience], settings: RunSettings) -> list[int]:
    """Which of a class's experiences to keep.

    Args:
        drawn: experiences of problems that the run drew itself.
        gained: candidates of problems that were gained on the job.
        settings: those of the run.

    Returns:
        [N] positions in ``drawn`` followed by ``gained``, the most useful first.
    """
    ours = _by_problem(drawn, 0)[: settings.wanted]
    rows = _alternating(ours, _by_problem(gained, len(drawn)))
    everything = [*drawn, *gained]
    candidates = [everything[row] for row in rows]
    kept = curate(candidates, settings.taught, said_vehicle(settings.vehicle)).tolist()
    if settings.grown:  # the others join these, and which ones hardly matters
        taken = {candidates[i].problem.id for i in kept}
        others = {each.problem.id: i for i, each in reversed([*enumerate(candidates)])}
        joining = sorted(i for identity, i in others.items() if identity not in taken)
        kept += joining[: settings.experiences - len(kept)]
    return [rows[i] for i in kept]


def _by_problem(experiences: Sequence[Experience], first: int) -> list[list[int]]:
    """The positions of the experiences, counted from ``first``, grouped by problem."""
    rows: dict[str, list[int]] = {}
    for row, each in enumerate(experiences, first):
        rows.setdefault(each.problem.id, []).append(row)
    return [*rows.values()]


def _alternating(ours: Sequence[list[int]], theirs: Sequence[list[int]]) -> list[int]:
    """The rows of our first problem, their first, our second …, so that curation considers both."""
    pairs = zip_longest(ours, theirs)
    return [row for pair in pairs for rows in pair for row in rows or ()]


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    candidates = COLLECT.keys(data, settings, name)
    gained = COLLECT_GAINED.keys(data, settings, name)
    inputs = [settings.wanted, settings.experiences, *candidates, *gained]
    return Cut(len(candidates), max(1, len(candidates)), inputs)


CURATE: Final = Stage(name="curate", do=curate_chunk, cut=_cut, output=lambda chunk: chunk.shard("curated"))
