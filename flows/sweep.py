"""Compare sizes of the encoder and learning rates."""

from __future__ import annotations

from tasks.fan_out.fan_out import run_stage
from tasks.reports.report import log_variants
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.sweep import SWEEP
from tasks.tracking.logbook import log_sweep


@stage_flow
def sweep(settings: RunSettings, data: str) -> None:
    """Train each variant on the hallucinated problems, and log them as children of one run."""
    variants = run_stage(SWEEP, data, settings)
    log_sweep(data, settings, variants)
    log_variants(variants)
