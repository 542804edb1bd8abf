"""Report what a run found."""

from __future__ import annotations

from prefect import flow

from tasks.artifacts import publish
from tasks.caching import run_folder
from tasks.draw import draw_figures, figure_chunks, is_drawn
from tasks.engine import fan_out, task_runner
from tasks.hold import holding
from tasks.logbook import log_report
from tasks.report import report_run, show
from tasks.settings import RunSettings
from tasks.stages import timed


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
