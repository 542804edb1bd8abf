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
from tasks.engine import cluster
from tasks.hold import holding
from tasks.logbook import run_logged
from tasks.settings import RunSettings


@flow(name="run")
@holding
def run(settings: RunSettings, data: str) -> None:
    """Collect, hallucinate, train, build memories, benchmark; again with less experience if asked; report."""
    with cluster(), run_logged(data, settings):
        collect(settings, data)
        hallucinate(settings, data)
        train(settings, data)
        build_memory(settings, data)
        benchmark(settings, data)
        continual(settings, data)
        report(settings, data)
