"""Benchmark the planners with and without memory."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import run_stage, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import BENCHMARK


@flow(name="benchmark", task_runner=task_runner())
@holding
@timed
def benchmark(settings: RunSettings, data: str) -> None:
    """Solve unseen problems of each class in every configuration, and keep a row of every attempt."""
    run_stage(BENCHMARK, data, settings)
