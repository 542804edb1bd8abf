"""Continual improvement: how planning gets faster with experience."""

from __future__ import annotations

from prefect import flow

from flows.benchmark import benchmark
from flows.build_memory import build_memory
from flows.collect import collect
from flows.hallucinate import hallucinate
from flows.train import train, train_ahead
from tasks.session.folder_lock import locks_data_folder
from tasks.settings.fewer_experiences import runs_of_continual
from tasks.settings.run_settings import RunSettings
from tasks.tracking.logbook import run_logged


@flow(name="continual", flow_run_name="continual {settings.title}")
@locks_data_folder
def continual(settings: RunSettings, data: str) -> None:
    """Collect, hallucinate, train, build and benchmark with a fifth, two fifths ... of the experiences."""
    runs = runs_of_continual(settings)
    for fewer in runs:
        with run_logged(data, fewer):
            collect(fewer, data)
            hallucinate(fewer, data)
    if runs:
        train_ahead(settings, data, runs)
    for fewer in runs:
        with run_logged(data, fewer):
            train(fewer, data)
            build_memory(fewer, data)
            benchmark(fewer, data)
