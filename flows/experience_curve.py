"""How recall improves with experience."""

from __future__ import annotations

from prefect import flow

from flows.build_memory import build_memory
from flows.collect import collect
from flows.hallucinate import hallucinate
from flows.train import train, train_ahead
from tasks.fan_out.fan_out import cluster
from tasks.reports.experience_curve import report_curve, runs_of_curve
from tasks.session.folder_lock import locks_data_folder
from tasks.settings.run_settings import RunSettings
from tasks.tracking.logbook import run_logged


@flow(name="experience-curve", flow_run_name="experience-curve {settings.title}")
@locks_data_folder
def experience_curve(settings: RunSettings, data: str) -> None:
    """Make memories of more and more experiences, each from the first stage on; compare their recall."""
    runs = runs_of_curve(settings)
    with cluster():
        for run in runs:
            with run_logged(data, run):
                collect(run, data)
                hallucinate(run, data)
        train_ahead(settings, data, runs)
        for run in runs:
            with run_logged(data, run):
                train(run, data)
                build_memory(run, data)
    report_curve(data, runs)
