"""Report: the tables and charts of a run, from its rows alone."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pandas as pd
from rich.console import Console

from dashboards.charts import planning_times, retrieval_curves
from dashboards.retrieval import retrieval_curve, summarise_retrieval
from dashboards.statistics import summarise
from dashboards.style import save
from dashboards.tables import as_csv, retrieval_markdown, retrieval_table, summary_markdown, summary_table
from storage.files import whole_file
from storage.recalls import read_recalls
from storage.results import read_attempts
from tasks.caching import run_folder
from tasks.settings import RunSettings

COLUMNS = 110  # of the tables where there is no terminal


class Report(NamedTuple):
    """What a run found."""

    summary: pd.DataFrame  # ``dashboards.statistics.summarise``
    retrieval: pd.DataFrame  # ``dashboards.retrieval.summarise_retrieval``


def report_run(data: str, settings: RunSettings) -> Report:
    """Write tables and charts into the run's folder; a StorageError where the run has no rows."""
    run = run_folder(data, settings)
    summary = summarise(read_attempts(run.results))
    curve = retrieval_curve(read_recalls(run.recalls))
    retrieval = summarise_retrieval(curve)
    _write(run.summary("csv"), as_csv(summary))
    _write(run.summary("md"), f"{summary_markdown(summary)}\n{retrieval_markdown(retrieval)}")
    save(planning_times(summary), run.figures, "planning-times")
    save(retrieval_curves(curve), run.figures, "retrieval")
    return Report(summary, retrieval)


def show(report: Report) -> None:
    """Print the tables."""
    console = Console(width=None if Console().is_terminal else COLUMNS, highlight=False)
    console.print(summary_table(report.summary))
    console.print(retrieval_table(report.retrieval))


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
