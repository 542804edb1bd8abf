"""Retrain: make challengers from new experiences, and promote those that are better."""

from __future__ import annotations

from prefect import flow

from flows.build_memory import build_memory
from flows.collect import collect
from flows.hallucinate import hallucinate
from flows.judge import judge
from flows.train import train
from tasks.champions.conclude import conclude
from tasks.champions.new_experience import runs_to_make
from tasks.fan_out.fan_out import cluster
from tasks.registry.champion_registry import Registry
from tasks.session.folder_lock import locked_folder
from tasks.settings.run_settings import RunSettings
from tasks.tracking.logbook import run_logged


@flow(name="retrain", flow_run_name="retrain {settings.title}")
def retrain(
    settings: RunSettings,
    data: str,
    approve: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
) -> None:
    """Make memories from what was learned since the champions, judge them, and promote the better ones."""
    settings = settings.for_retraining()
    with locked_folder(data) as folder, cluster(workers, scheduler):
        registry = Registry(folder)
        for run in runs_to_make(folder, settings, registry):
            with run_logged(data, run.settings):
                collect(run.settings, data)
                hallucinate(run.settings, data)
                train(run.settings, data)
                build_memory(run.settings, data)
                judge(run.settings, data)
                conclude(data, run, registry, approve)
