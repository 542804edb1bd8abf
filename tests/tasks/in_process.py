"""Stages done in this process, without Prefect and Dask."""

from __future__ import annotations

from typing import TypeVar

from tasks.fan_out.chunk import Chunk
from tasks.fan_out.stage import Stage, Values
from tasks.inputs.shortfalls import begin_collecting, leave_out
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import COLLECT
from tasks.stages.collect_gained import COLLECT_GAINED
from tasks.stages.curate import CURATE
from tasks.stages.keep_experiences import COMBINE, KEEP

Result = TypeVar("Result", bound=Values | None)


def run_stage(
    stage: Stage[Result], data: str, settings: RunSettings, backwards: bool = False
) -> dict[Chunk, Result]:
    """Do every chunk of a stage, in its order or in the other; the results."""
    results: dict[Chunk, Result] = {}
    while left := [chunk for chunk in stage.chunks(data, settings) if chunk not in results]:
        results |= {chunk: stage.run(chunk).result for chunk in (left[::-1] if backwards else left)}
    return results


def collect(data: str, settings: RunSettings, backwards: bool = False) -> RunSettings:
    """Leave the experiences of a run in a data folder; the settings without the classes left out."""
    settings = begin_collecting(data, settings)
    for stage in (COLLECT, COLLECT_GAINED, CURATE):
        run_stage(stage, data, settings, backwards)
    settings = leave_out(data, settings)
    for stage in (KEEP, COMBINE):
        run_stage(stage, data, settings, backwards)
    return settings
