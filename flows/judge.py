"""Judge the memories of a run against the champions."""

from __future__ import annotations

from tasks.fan_out.fan_out import run_stage
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.judge import CHECK_PLANS, JUDGE


@stage_flow
def judge(settings: RunSettings, data: str) -> None:
    """Check every plan once more, then attempt held-back problems with champions and challengers."""
    run_stage(CHECK_PLANS, data, settings)
    run_stage(JUDGE, data, settings)
