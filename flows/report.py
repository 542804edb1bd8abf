"""Report on a run."""

from __future__ import annotations

from tasks.fan_out.chunk import run_folder
from tasks.fan_out.fan_out import run_stage
from tasks.reports.report import log_tables, report_run
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.draw_examples import DRAW_EXAMPLES
from tasks.tracking.artifacts import publish
from tasks.tracking.report_log import log_report, pages_of


@stage_flow
def report(settings: RunSettings, data: str) -> None:
    """Turn the rows of a run into tables and figures, and log them."""
    run_stage(DRAW_EXAMPLES, data, settings)
    results, run = report_run(data, settings), run_folder(data, settings)
    log_report(data, settings, results)
    publish(run, results.claims + results.others, pages_of(data, settings))
    log_tables(results, run)
