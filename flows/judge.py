"""Judge what a run made against the champions."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.judge import check_plans, is_judged, judge_chunks, judge_problems, plan_chunks


@flow(name="judge", task_runner=task_runner())
@holding
@timed
def judge(settings: RunSettings, data: str) -> None:
    """Check every plan once more, then attempt held-back problems with champions and challengers."""
    fan_out(check_plans, plan_chunks(data, settings), "check plans", lambda _: True)
    fan_out(judge_problems, judge_chunks(data, settings), "judge", is_judged)
