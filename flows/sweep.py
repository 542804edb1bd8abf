"""Compare sizes of the encoder and learning rates."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.reports.report import show_sweep
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.sweep import is_swept, sweep_chunks, sweep_variant
from tasks.tracking.logbook import log_sweep


@flow(name="sweep", task_runner=task_runner())
@holding
def sweep(settings: RunSettings, data: str) -> None:
    """Train each variant on the hallucinated problems, as children of one run, and print what came of it."""
    chunks = sweep_chunks(data, settings)
    fan_out(sweep_variant, chunks, "sweep, epochs", is_swept)
    log_sweep(data, settings, chunks)
    show_sweep(chunks)
