"""Retrain: challengers from what was learned since, promoted where they are better."""

from __future__ import annotations

from prefect import flow

from flows.build_memory import build_memory
from flows.collect import collect
from flows.hallucinate import hallucinate
from flows.judge import judge
from flows.train import train
from tasks.champions.conclude import conclude
from tasks.champions.new_experience import rounds
from tasks.champions.retraining_schedule import print_failure
from tasks.fan_out.fan_out import cluster
from tasks.registry.champion_registry import Registry
from tasks.session.folder_lock import locked_folder
from tasks.settings.run_settings import RunSettings
from tasks.tracking.logbook import run_logged


@flow(name="retrain", on_failure=[print_failure])  # type: ignore[list-item]  # meant for methods
def retrain(
    settings: RunSettings,
    data: str,
    approve: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
) -> None:
    """Make memories of what was learned since the champions, judge them, and promote what is better."""
    with locked_folder(data) as folder, cluster(workers, scheduler):
        registry = Registry(folder)
        for made in rounds(folder, settings, registry):
            with run_logged(data, made.settings):
                collect(made.settings, data)
                hallucinate(made.settings, data)
                train(made.settings, data)
                build_memory(made.settings, data)
                judge(made.settings, data)
                conclude(data, made, registry, approve)
