"""Train an encoder for each memory."""

from __future__ import annotations

from tasks.fan_out.fan_out import run_stage
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.train import TRAIN
from tasks.tracking.logbook import log_training


@stage_flow
def train(settings: RunSettings, data: str) -> None:
    """Train an encoder for each class, and one for all of them if wanted, epoch by epoch."""
    encoders = run_stage(TRAIN, data, settings)
    log_training(data, settings, encoders)
