"""Report: tables, figures and the page of a run, from its rows alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import pandas as pd
from rich.console import Console

from dashboards.figures.bars import ablation, controls, planning_times, time_split
from dashboards.figures.planning_curves import continual_improvement, performance_profile, solved_against_time
from dashboards.figures.recall_curves import retrieval_curves
from dashboards.figures.style import save
from dashboards.report.tables import (
    as_csv,
    claims_markdown,
    retrieval_markdown,
    retrieval_table,
    stages_table,
    summary_markdown,
    summary_table,
    sweep_table,
)
from dashboards.statistics.distributions import performance_profile as profile_curve
from dashboards.statistics.distributions import solved_against_time as solved_curve
from dashboards.statistics.distributions import time_split as split_of
from dashboards.statistics.panels import summarise, summarise_continual
from dashboards.statistics.retrieval_rates import retrieval_curve, summarise_retrieval
from dashboards.verdicts.claim_rules import Claim
from dashboards.verdicts.claims import claims
from dashboards.verdicts.evidence import Evidence
from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.files import whole_file
from storage.places.mirror import is_there
from storage.places.run_folder import RunFolder
from storage.tables.attempts import distinct_values, read_attempts
from storage.tables.recalls import read_recalls
from tasks.fan_out.chunk import Chunk, run_folder
from tasks.reports.report_details import page_of
from tasks.reports.stage_times import stage_cells, stages_of
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.measure_recall import MEASURE_RECALL
from tasks.stages.sweep import sweep_rows

COLUMNS = 110  # of the tables where there is no terminal
NOT_NEEDED: Final = (
    "recalled", "run_id", "vehicle", "verified", "seed", "nodes", "expansions", "length_m", "duration_s",
    "host", "commit",
)  # fmt: skip
MEASURED: Final = (
    "preset",
    "classes",
    "worlds",
    "planners",
    "assists",
    "test_problems",
    "combined",
    "strict",
    "candidates",
    "continual",
)


_MEASURED_BY: Final = ["problem_class", "planner"]


class Report(NamedTuple):
    """What a run found."""

    summary: pd.DataFrame  # ``dashboards.statistics.panels.summarise``
    retrieval: pd.DataFrame  # ``dashboards.statistics.retrieval_rates.summarise_retrieval``
    claims: list[Claim]


def report_run(data: str, settings: RunSettings) -> Report:
    """Write tables, charts and the page into the run's folder; a StorageError where the run has no rows."""
    run = run_folder(data, settings)
    attempts = read_attempts(run.results, NOT_NEEDED)
    grown = continual_rows(data, settings, attempts)
    summary, recalls = summarise(attempts), _recall_rows(data, settings)
    found = Report(summary, report_retrieval(data, settings), claims(Evidence(attempts, recalls, grown)))
    _write(run.summary("csv"), as_csv(summary))
    texts = [summary_markdown(summary), retrieval_markdown(found.retrieval), claims_markdown(found.claims)]
    _write(run.summary("md"), "\n".join(texts))
    figures = {
        "planning-times": planning_times(summary),
        "controls": controls(summary),
        "solved-against-time": solved_against_time(solved_curve(attempts)),
        "performance-profile": performance_profile(profile_curve(attempts)),
        "time-split": time_split(split_of(attempts)),
    }
    if (summary["recall"] == "random").any():
        figures["ablation"] = ablation(summary)
    if len(grown):
        figures["continual-improvement"] = continual_improvement(summarise_continual(grown))
    for name, figure in figures.items():
        save(figure, run.figures, name)
    made_by = {name: distinct_values(run.results, name) for name in ("host", "commit")}
    html = page_of(run, settings, attempts, summary, found.retrieval, found.claims, made_by)
    _write(run.report, html)
    return found


def continual_rows(data: str, settings: RunSettings, attempts: pd.DataFrame) -> pd.DataFrame:
    """The run's ``attempts``, and those of all runs that differ from it in ``experiences``, a column here.

    Which planners, assists and problems they measured may differ too: a planner on a class is here if several
    runs measured it, and so are the attempts with the combined memory. Empty where there is no other number.
    """
    own = run_folder(data, settings)
    places: dict[int, Path] = {}
    for run in open_data_folder(data).runs():
        if run.path == own.path or not (is_there(run.settings) and is_there(run.results)):
            continue
        try:
            asked = recorded_settings(run)
        except StorageError:  # of another version, or edited
            continue
        may_differ = {name: getattr(settings, name) for name in (*MEASURED, "experiences")}
        if replace(asked, **may_differ) == settings and asked.experiences != settings.experiences:
            places.setdefault(asked.experiences, run.results)
    if not places:
        return pd.DataFrame()
    tables = {count: read_attempts(place, NOT_NEEDED) for count, place in places.items()}
    others = pd.concat([table[_MEASURED_BY].drop_duplicates() for table in tables.values()])
    known = pd.MultiIndex.from_frame(others.drop_duplicates())
    tables[settings.experiences] = attempts[pd.MultiIndex.from_frame(attempts[_MEASURED_BY]).isin(known)]
    rows = pd.concat(
        [table.assign(experiences=count) for count, table in sorted(tables.items())], ignore_index=True
    )
    combined = rows["memory"] == COMBINED
    if rows.loc[combined, "experiences"].nunique() < 2:
        rows = rows[~combined]
    measured = rows.groupby(_MEASURED_BY)["experiences"].transform("nunique")
    return rows[measured > 1]


def report_retrieval(data: str, settings: RunSettings) -> pd.DataFrame:
    """Write the table and the chart of what the memories recall; gives the table."""
    run = run_folder(data, settings)
    curve = retrieval_curve(_recall_rows(data, settings))
    retrieval = summarise_retrieval(curve)
    _write(run.retrieval, as_csv(retrieval))
    save(retrieval_curves(curve), run.figures, "retrieval")
    return retrieval


def _recall_rows(data: str, settings: RunSettings) -> pd.DataFrame:
    return read_recalls([chunk.shard("recalls") for chunk in MEASURE_RECALL.chunks(data, settings)])


def show(report: Report, run: RunFolder) -> None:
    """Print the tables, and how the stages went."""
    console().print(summary_table(report.summary))
    show_retrieval(report.retrieval)
    console().print(stages_table(stage_cells(stages_of(run))))


def show_retrieval(retrieval: pd.DataFrame) -> None:
    """Print what the memories recall."""
    console().print(retrieval_table(retrieval))


def show_sweep(chunks: Iterable[Chunk]) -> None:
    """Print what the variants of a sweep came to."""
    console().print(sweep_table(sweep_rows(chunks)))


def console() -> Console:
    """Where tables are printed: as wide as the terminal, or as tables are without one."""
    return Console(width=None if Console().is_terminal else COLUMNS, highlight=False)


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
