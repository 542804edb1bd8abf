"""Train an encoder for each memory."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.train import class_epochs, class_epochs_done, is_trained, train_chunks, train_encoder
from tasks.tracking.logbook import log_training


@flow(name="train", task_runner=task_runner())
@holding
@timed
def train(settings: RunSettings, data: str) -> None:
    """Train one encoder for each class, and one for all of them if wanted, epoch by epoch."""
    chunks = train_chunks(data, settings)
    results = fan_out(
        train_encoder,
        chunks,
        "train, epochs of a class",
        is_trained,
        class_epochs,
        lambda: class_epochs_done(chunks),
    )
    log_training(data, settings, chunks, results)
