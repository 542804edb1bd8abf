"""Collect experiences: solved problems with their plans."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.fan_out.stage import Chunk, keep_settings
from tasks.inputs.problem_sources import read_worlds, tell_skipped, world_chunks, worlds_are_read
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import chunks_wanted, collect_problems, is_collected
from tasks.stages.curate import (
    curate_candidates,
    curation_chunks,
    improve_kept,
    improvement_chunks,
    is_curated,
    is_improved,
    keep_experiences,
)


@flow(name="collect", task_runner=task_runner())
@holding
@timed
def collect(settings: RunSettings, data: str) -> None:
    """Draw problems of each class, solve them, check the plans, and keep the N most useful of each class."""
    keep_settings(data, settings)
    tell_skipped(fan_out(read_worlds, world_chunks(data, settings), "read worlds", worlds_are_read))
    done: dict[Chunk, dict[str, int]] = {}
    while chunks := chunks_wanted(data, settings, done):
        done |= zip(chunks, fan_out(collect_problems, chunks, "collect", is_collected), strict=True)
    curated = curation_chunks(data, settings, done)
    fan_out(curate_candidates, curated, "curate", is_curated)
    improved = improvement_chunks(data, settings, curated)
    fan_out(improve_kept, improved, "optimise", is_improved)
    keep_experiences(data, settings, curated, improved)
