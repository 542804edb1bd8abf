"""Report: the tables and charts of a run, from its rows alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from rich.console import Console

from dashboards.charts import planning_times, retrieval_curves
from dashboards.retrieval import retrieval_curve, summarise_retrieval
from dashboards.statistics import summarise
from dashboards.style import save
from dashboards.sweep import sweep_table
from dashboards.tables import as_csv, retrieval_markdown, retrieval_table, summary_markdown, summary_table
from storage.files import whole_file
from storage.recalls import read_recalls
from storage.results import read_attempts
from tasks.caching import Chunk, run_folder
from tasks.recalls import recall_chunks
from tasks.settings import RunSettings
from tasks.sweep import sweep_rows

COLUMNS = 110  # of the tables where there is no terminal


class Report(NamedTuple):
    """What a run found."""

    summary: pd.DataFrame  # ``dashboards.statistics.summarise``
    retrieval: pd.DataFrame  # ``dashboards.retrieval.summarise_retrieval``


def report_run(data: str, settings: RunSettings) -> Report:
    """Write tables and charts into the run's folder; a StorageError where the run has no rows."""
    run = run_folder(data, settings)
    summary = summarise(read_attempts(run.results))
    retrieval = report_retrieval(data, settings)
    _write(run.summary("csv"), as_csv(summary))
    _write(run.summary("md"), f"{summary_markdown(summary)}\n{retrieval_markdown(retrieval)}")
    save(planning_times(summary), run.figures, "planning-times")
    return Report(summary, retrieval)


def report_retrieval(data: str, settings: RunSettings) -> pd.DataFrame:
    """Write the table and the chart of what the memories recall; gives the table."""
    run = run_folder(data, settings)
    shards = [run.shard("recalls", chunk.class_name, chunk.index) for chunk in recall_chunks(data, settings)]
    curve = retrieval_curve(read_recalls(shards))
    retrieval = summarise_retrieval(curve)
    _write(run.path / "retrieval.csv", as_csv(retrieval))
    save(retrieval_curves(curve), run.figures, "retrieval")
    return retrieval


def show(report: Report) -> None:
    """Print the tables."""
    _console().print(summary_table(report.summary))
    show_retrieval(report.retrieval)


def show_retrieval(retrieval: pd.DataFrame) -> None:
    """Print what the memories recall."""
    _console().print(retrieval_table(retrieval))


def show_sweep(chunks: Sequence[Chunk]) -> None:
    """Print what the variants of a sweep came to."""
    _console().print(sweep_table(sweep_rows(chunks)))


def _console() -> Console:
    return Console(width=None if Console().is_terminal else COLUMNS, highlight=False)


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
