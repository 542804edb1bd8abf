"""The main job: every stage, one after another."""

from __future__ import annotations

from prefect import flow

from flows.benchmark import benchmark
from flows.build_memory import build_memory
from flows.collect import collect
from flows.continual import continual
from flows.hallucinate import hallucinate
from flows.report import report
from flows.train import train
from tasks.fan_out.chunk import run_folder
from tasks.fan_out.fan_out import cluster
from tasks.session.folder_lock import locks_data_folder
from tasks.settings.fewer_experiences import runs_of_continual
from tasks.settings.run_settings import RunSettings
from tasks.tracking.artifacts import publish_pages
from tasks.tracking.logbook import run_logged
from tasks.tracking.report_log import pages_of


@flow(name="run", flow_run_name="run {settings.title}")
@locks_data_folder
def run(settings: RunSettings, data: str) -> None:
    """Do every stage, then the same with fewer experiences if the settings ask for it, and report."""
    runs_of_continual(settings)  # is refused now, rather than after hours, if there are too few experiences
    with cluster(), run_logged(data, settings):
        collect(settings, data)
        hallucinate(settings, data)
        train(settings, data)
        build_memory(settings, data)
        benchmark(settings, data)
        continual(settings, data)
        report(settings, data)
        publish_pages(run_folder(data, settings), pages_of(data, settings))
