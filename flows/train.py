"""Train an encoder for each memory."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, run_stage, task_runner
from tasks.inputs.shortfalls import as_collected
from tasks.session.folder_lock import locks_data_folder
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.train import TRAIN
from tasks.tracking.logbook import log_training


@stage_flow
def train(settings: RunSettings, data: str) -> None:
    """Train an encoder for each class, and one for all of them if wanted, epoch by epoch."""
    encoders = run_stage(TRAIN, data, settings)
    log_training(data, settings, encoders)


@flow(name="train-ahead", flow_run_name="train ahead {settings.title}", task_runner=task_runner())
@locks_data_folder
def train_ahead(settings: RunSettings, data: str, runs: list[RunSettings]) -> None:
    """Train the encoders of several ``runs`` at the same time; these settings are of the run they belong to.

    An encoder keeps one core busy, so runs of one class that are trained one after another leave the others
    idle. The flow ``train`` of each run finds its encoders trained, and logs them.
    """
    longest_first = reversed(runs)  # by their experiences
    fan_out(TRAIN, [chunk for run in longest_first for chunk in TRAIN.chunks(data, as_collected(data, run))])
