"""Benchmark the planners with and without memory."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import benchmark_chunks, benchmark_problems, is_benchmarked


@flow(name="benchmark", task_runner=task_runner())
@holding
@timed
def benchmark(settings: RunSettings, data: str) -> None:
    """Solve unseen problems of each class in every configuration, and keep a row of every attempt."""
    fan_out(benchmark_problems, benchmark_chunks(data, settings), "benchmark", is_benchmarked)
