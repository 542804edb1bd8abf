"""Build memories from encoders and experiences, and see what they recall."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.reports.report import report_retrieval, show_retrieval
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.build_memory import build_one_memory, is_built, memory_chunks
from tasks.stages.measure_recall import is_recalled, recall_chunks, recall_problems
from tasks.tracking.logbook import log_memories


@flow(name="build-memory", task_runner=task_runner())
@holding
@timed
def build_memory(settings: RunSettings, data: str) -> None:
    """Join encoder, centroids and plans into one archive a memory, and measure what it recalls."""
    chunks = memory_chunks(data, settings)
    built = fan_out(build_one_memory, chunks, "build memories", is_built)
    fan_out(recall_problems, recall_chunks(data, settings), "recall", is_recalled)
    found = report_retrieval(data, settings)
    log_memories(data, settings, chunks, built, found)
    show_retrieval(found)
