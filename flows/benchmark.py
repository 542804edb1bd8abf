"""Benchmark the planners with and without memory."""

from __future__ import annotations

from prefect import flow

from tasks.benchmark import benchmark_chunks, benchmark_problems, is_benchmarked
from tasks.engine import fan_out, task_runner
from tasks.hold import holding
from tasks.settings import RunSettings
from tasks.stages import timed


@flow(name="benchmark", task_runner=task_runner())
@holding
@timed
def benchmark(settings: RunSettings, data: str) -> None:
    """Solve unseen problems of each class in every configuration, and keep a row of every attempt."""
    fan_out(benchmark_problems, benchmark_chunks(data, settings), "benchmark", is_benchmarked)
