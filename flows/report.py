"""Report what a run found."""

from __future__ import annotations

from prefect import flow

from tasks.logbook import log_report
from tasks.report import report_run, show
from tasks.settings import RunSettings


@flow(name="report")
def report(settings: RunSettings, data: str) -> None:
    """Turn the rows of a run into tables and figures, print the tables, and log all of it."""
    found = report_run(data, settings)
    log_report(data, settings, found)
    show(found)
