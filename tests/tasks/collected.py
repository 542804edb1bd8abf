"""Collecting in this process, without Prefect and Dask: what later stages need to be tried."""

from __future__ import annotations

from typing import Any

from tasks.fan_out.stage import Chunk, keep_settings
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import chunks_wanted, collect_chunk
from tasks.stages.curate import curate_chunk, curation_chunks, keep_experiences


def collect(data: str, settings: RunSettings) -> None:
    """Leave the experiences of a run in a data folder."""
    keep_settings(data, settings)
    done: dict[Chunk, dict[str, Any]] = {}
    while chunks := chunks_wanted(data, settings, done):
        done |= {chunk: collect_chunk(chunk) for chunk in chunks}
    curated = curation_chunks(data, settings, done)
    for chunk in curated:
        curate_chunk(chunk)
    keep_experiences(data, settings, curated, [])
