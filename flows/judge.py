"""Judge what a run made against the champions."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import run_stage, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.judge import CHECK_PLANS, JUDGE


@flow(name="judge", task_runner=task_runner())
@holding
@timed
def judge(settings: RunSettings, data: str) -> None:
    """Check every plan once more, then attempt held-back problems with champions and challengers."""
    run_stage(CHECK_PLANS, data, settings)
    run_stage(JUDGE, data, settings)
