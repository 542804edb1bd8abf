"""Build memories from encoders and experiences, and measure what they recall."""

from __future__ import annotations

from prefect.runtime import flow_run

from tasks.fan_out.fan_out import run_stage
from tasks.reports.report import log_retrieval, report_retrieval
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.measure_recall import MEASURE_RECALL
from tasks.tracking.logbook import log_memories


@stage_flow
def build_memory(settings: RunSettings, data: str) -> None:
    """Join encoder, centroids and plans into one archive for each memory, and measure what it recalls."""
    memories = run_stage(BUILD_MEMORY, data, settings)
    run_stage(MEASURE_RECALL, data, settings)
    retrieval = report_retrieval(data, settings)
    log_memories(data, settings, memories, retrieval)
    if flow_run.parent_flow_run_id is None:  # larger flows tell it in their reports, or only their verdicts
        log_retrieval(retrieval)
