"""Report on a run."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.chunk import run_folder
from tasks.fan_out.fan_out import run_stage, task_runner
from tasks.reports.report import report_run, show
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.draw_examples import DRAW_EXAMPLES
from tasks.tracking.artifacts import publish
from tasks.tracking.logbook import log_report


@flow(name="report", task_runner=task_runner())
@holding
@timed
def report(settings: RunSettings, data: str) -> None:
    """Turn the rows of a run into tables and figures, print the tables, and log all of it."""
    run_stage(DRAW_EXAMPLES, data, settings)
    results, run = report_run(data, settings), run_folder(data, settings)
    log_report(data, settings, results)
    publish(run, results.claims)
    show(results, run)
