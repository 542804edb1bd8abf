"""Report: tables and figures of a run, from its rows alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console

from dashboards.charts import planning_times, retrieval_curves, training_curves
from dashboards.pictures import Example, gallery
from dashboards.retrieval import retrieval_curve, summarise_retrieval
from dashboards.statistics import summarise
from dashboards.style import save
from dashboards.tables import as_csv, retrieval_markdown, retrieval_table, summary_markdown, summary_table
from planners.solve import solve
from storage.encoders import load_encoder
from storage.files import whole_file
from storage.memories import load_memory
from storage.recalls import read_recalls
from storage.results import read_attempts
from tasks.caching import run_folder
from tasks.settings import RunSettings
from tasks.train import memory_names
from tasks.worlds import source_of

SHOWN_PLANNER = "gust"  # of the pictures
SHOWN_TOP_K = 5


class Report(NamedTuple):
    """What a run found."""

    summary: pd.DataFrame  # ``dashboards.statistics.summarise``
    retrieval: pd.DataFrame  # ``dashboards.retrieval.summarise_retrieval``
    figures: list[Path]


def report_run(data: str, settings: RunSettings) -> Report:
    """Write summary and figures into the run's folder; a StorageError where the run has no rows."""
    run = run_folder(data, settings)
    attempts = read_attempts(run.results)
    summary = summarise(attempts)
    curve = retrieval_curve(read_recalls(run.recalls))
    retrieval = summarise_retrieval(curve)
    _write(run.summary("csv"), as_csv(summary))
    _write(run.summary("md"), f"{summary_markdown(summary)}\n{retrieval_markdown(retrieval)}")
    drawn = {"planning-times": planning_times(summary), "retrieval": retrieval_curves(curve)}
    for name in memory_names(settings):
        history = load_encoder(run.model(name)).history
        drawn[f"training-{name}"] = training_curves(pd.DataFrame(epoch._asdict() for epoch in history))
    for name in settings.class_names:
        drawn[f"problems-{name}"] = _examples(data, settings, name, attempts)
    return Report(
        summary,
        retrieval,
        [path for name, figure in drawn.items() for path in save(figure, run.figures, name)],
    )


def show(report: Report) -> None:
    """Print the tables."""
    console = Console(width=None if Console().is_terminal else 110, highlight=False)
    console.print(summary_table(report.summary))
    console.print(retrieval_table(report.retrieval))


def _examples(data: str, settings: RunSettings, class_name: str, attempts: pd.DataFrame) -> Figure:
    """Some problems with what was recalled and found: solved again, which gives the same plans."""
    return gallery(list(_pick(data, settings, class_name, attempts)))


def _pick(data: str, settings: RunSettings, class_name: str, attempts: pd.DataFrame) -> Iterator[Example]:
    rows = attempts[(attempts["problem_class"] == class_name) & (attempts["memory"] == class_name)]
    planner = SHOWN_PLANNER if SHOWN_PLANNER in settings.planners else settings.planners[0]
    rows = rows[(rows["planner"] == planner) & (rows["assist"] == "open") & (rows["top_k"] == SHOWN_TOP_K)]
    places = {identity: index for index, identity in enumerate(rows["problem_id"])}
    source = source_of(data, settings, class_name)
    memory = load_memory(run_folder(data, settings).memory(class_name))
    for kind in ("recalled", "searched"):
        for row in rows[rows["source"] == kind].head(2).itertuples():
            problem = source.problem("test", places[str(row.problem_id)])
            attempt = solve(problem, planner, "open", SHOWN_TOP_K, memory, settings.seed)
            caption = f"{problem.id}: {kind}, {1000.0 * float(str(row.planning_seconds)):.1f} ms"
            yield Example(problem, [memory.plans[i] for i in attempt.recalled], attempt.plan, caption)


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
