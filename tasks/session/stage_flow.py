"""The flow of a stage of a run."""

from __future__ import annotations

from collections.abc import Callable

from prefect import Flow, flow

from tasks.fan_out.fan_out import task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings


def stage_flow(stage: Callable[[RunSettings, str], None]) -> Flow[[RunSettings, str], None]:
    """Make a flow that locks its data folder, uses the shared cluster, and records how long it took."""
    return flow(name=stage.__name__.replace("_", "-"), task_runner=task_runner())(holding(timed(stage)))
