"""Train an encoder for each memory."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import run_stage, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.train import TRAIN
from tasks.tracking.logbook import log_training


@flow(name="train", task_runner=task_runner())
@holding
@timed
def train(settings: RunSettings, data: str) -> None:
    """Train an encoder for each class, and one for all of them if wanted, epoch by epoch."""
    encoders = run_stage(TRAIN, data, settings)
    log_training(data, settings, encoders)
