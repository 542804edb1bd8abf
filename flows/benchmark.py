"""Benchmark the planners with and without memory."""

from __future__ import annotations

from tasks.fan_out.fan_out import run_stage
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import BENCHMARK


@stage_flow
def benchmark(settings: RunSettings, data: str) -> None:
    """Solve unseen problems of each class in every configuration, and write a row for every attempt."""
    run_stage(BENCHMARK, data, settings)
