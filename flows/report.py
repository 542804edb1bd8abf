"""Report what a run found."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.fan_out.stage import run_folder
from tasks.reports.report import report_run, show
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.draw_examples import draw_figures, figure_chunks, is_drawn
from tasks.tracking.artifacts import publish
from tasks.tracking.logbook import log_report


@flow(name="report", task_runner=task_runner())
@holding
@timed
def report(settings: RunSettings, data: str) -> None:
    """Turn the rows of a run into tables and figures, print the tables, and log all of it."""
    fan_out(draw_figures, figure_chunks(data, settings), "draw", is_drawn)
    found, run = report_run(data, settings), run_folder(data, settings)
    log_report(data, settings, found)
    publish(run, found.claims)
    show(found, run)
