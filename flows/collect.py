"""Collect experiences: solved problems with their plans."""

from __future__ import annotations

from tasks.fan_out.fan_out import run_stage
from tasks.inputs.shortfalls import begin_collecting, leave_out
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import COLLECT
from tasks.stages.collect_gained import COLLECT_GAINED
from tasks.stages.curate import CURATE
from tasks.stages.keep_experiences import COMBINE, KEEP
from tasks.stages.read_worlds import READ_WORLDS, log_skipped


@stage_flow
def collect(settings: RunSettings, data: str) -> None:
    """Draw problems of each class, solve them, polish and check the plans, and keep each class's N best."""
    settings = begin_collecting(data, settings)
    worlds = run_stage(READ_WORLDS, data, settings)
    log_skipped(worlds.values())
    run_stage(COLLECT, data, settings)
    run_stage(COLLECT_GAINED, data, settings)
    run_stage(CURATE, data, settings)
    settings = leave_out(data, settings)
    run_stage(KEEP, data, settings)
    run_stage(COMBINE, data, settings)
