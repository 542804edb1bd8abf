"""Log the report of a run in MLflow: the findings, all figures, and the value of each model."""

from __future__ import annotations

import math
from typing import Final

from dashboards.report.findings import findings_markdown
from dashboards.statistics.headline import headline
from tasks.fan_out.chunk import run_folder
from tasks.fan_out.keys import key_of
from tasks.reports.report import Report
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import BENCHMARK
from tasks.tracking.logbook import child_run, log_headline, retrieval_metrics
from tasks.tracking.mlflow_runs import tracker
from tasks.tracking.parameters import parameters_of
from tasks.tracking.provenance import flow_run_tags

COMPARED: Final = ("controls", "planning-times", "retrieval")  # pictures on the parent run
_SUMMARY_METRICS = (
    "solved", "mean_ms", "interquartile_mean_ms", "median_ms", "p90_ms", "reduction", "slower", "recalled",
    "collision_checks", "driving_s", "sooner_s",
)  # fmt: skip


def log_report(data: str, settings: RunSettings, report: Report) -> None:
    """Log the benchmark as a child run; log the findings and the headline metrics on the parent run.

    Args:
        data: the data folder.
        settings: the settings of the run.
        report: the results of the run.
    """
    log, run = tracker(data), run_folder(data, settings)
    key = key_of([chunk.key for chunk in BENCHMARK.chunks(data, settings)])
    log_headline(data, settings, headline(report.summary, report.retrieval), COMPARED)
    with child_run(data, settings, "benchmark") as run_id:
        log.parameters(run_id, parameters_of(settings))
        log.artifacts(run_id, run.figures, "figures")
        for path in (run.summary("csv"), run.summary("md"), run.report):
            log.artifacts(run_id, path)
        if not log.is_logged(run_id, key):
            _log_figures(data, settings, report, run_id)
            log.dataset(run_id, "attempts", run.results, key, "benchmark")
            log.mark_logged(run_id, key)
    parent = log.find(settings.run_name, "run")
    if parent is not None:
        log.tag(parent, {"mlflow.note.content": _description(data, settings, report)})


def _log_figures(data: str, settings: RunSettings, report: Report, run_id: str) -> None:
    """Log the figures of every class, planner and configuration, and the value of each model."""
    log = tracker(data)
    metrics: dict[str, float] = {}
    for row in report.summary.to_dict("records"):
        prefix = f"{row['panel']}/{row['planner']}/{row['configuration'].replace(' ', '-')}"
        metrics |= {f"{prefix}/{name}": row[name] for name in _SUMMARY_METRICS}
    metrics |= retrieval_metrics(report.retrieval)
    log.metrics(run_id, [{name: value for name, value in metrics.items() if math.isfinite(value)}])
    for name in settings.class_names:
        of_class = [table[table["panel"] == name] for table in (report.summary, report.retrieval)]
        worth = {f"{name}/{figure}": value for figure, value in headline(*of_class).items()}
        log.metrics(run_id, [worth], model_id=log.model_of(settings.run_name, name))


def pages_of(data: str, settings: RunSettings) -> dict[str, str]:
    """Pages in MLflow about a run, by title; none if MLflow is a database without a server."""
    log = tracker(data)
    run, benchmark = (log.find(settings.run_name, stage) for stage in ("run", "benchmark"))
    pages = {
        "Report": log.page(benchmark, "report.html") if benchmark else None,
        "MLflow": log.page(run) if run else None,
    }
    return {title: page for title, page in pages.items() if page}


def _description(data: str, settings: RunSettings, report: Report) -> str:
    """The top of a run's page in MLflow: the findings, and links to the report and to Prefect."""
    prefect = flow_run_tags().get("prefect.flow_run_url")
    links = pages_of(data, settings) | ({"Run in Prefect": prefect} if prefect else {})
    linked = [f"[{name}]({address})" for name, address in links.items() if name != "MLflow"]
    return "\n\n".join([findings_markdown(report.summary), " · ".join(linked)]).strip()
