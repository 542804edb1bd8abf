"""Compare sizes of the encoder and learning rates."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import run_stage, task_runner
from tasks.reports.report import log_variants
from tasks.session.folder_lock import locks_data_folder
from tasks.settings.run_settings import RunSettings
from tasks.stages.sweep import SWEEP
from tasks.tracking.logbook import log_sweep


@flow(name="sweep", flow_run_name="sweep {settings.title}", task_runner=task_runner())
@locks_data_folder
def sweep(settings: RunSettings, data: str) -> None:
    """Train each variant on the hallucinated problems, and log them as children of one run."""
    variants = run_stage(SWEEP, data, settings)
    log_sweep(data, settings, variants)
    log_variants(variants)
