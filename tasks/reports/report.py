"""Report: the tables, figures and page of a run, made from its rows alone."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Final, NamedTuple

import pandas as pd

from dashboards.figures.bars import ablation, controls, planning_times, time_split
from dashboards.figures.planning_curves import continual_improvement, performance_profile, solved_against_time
from dashboards.figures.recall_curves import retrieval_curves
from dashboards.figures.style import save
from dashboards.report.findings import findings, findings_markdown
from dashboards.report.retrieval_tables import retrieval_markdown, retrieval_table
from dashboards.report.tables import (
    as_csv,
    claims_markdown,
    stages_table,
    summary_markdown,
    summary_tables,
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
from storage.tables.configurations import as_found
from storage.tables.recalls import read_recalls
from tasks.attempts.judged_attempts import is_unaccepted
from tasks.fan_out.chunk import Chunk, run_folder
from tasks.inputs.shortfalls import shortfalls
from tasks.reports.report_details import page_of
from tasks.reports.stage_times import stage_cells, stages_of
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.measure_recall import MEASURE_RECALL
from tasks.stages.sweep import sweep_rows

NOT_NEEDED: Final = (
    "recalled", "run_id", "vehicle", "seed", "nodes", "expansions", "length_m",
    "host", "commit",
)  # fmt: skip
MAY_DIFFER: Final = (  # settings that may differ between runs compared by their number of experiences
    "experiences", "preset", "classes", "worlds", "planners", "assists", "test_problems", "combined",
    "strict", "candidates", "continual", "left_out",
)  # fmt: skip
ALIKE: Final = ("classes", "worlds", "difficulty", "seed", "vehicle")  # of runs by the two methods
MEASURED_ON: Final = ["problem_class", "planner"]

LINE: Final = 110  # characters
_LOG = logging.getLogger(__name__)


class Report(NamedTuple):
    """The results of a run."""

    summary: pd.DataFrame  # ``dashboards.statistics.panels.summarise``
    retrieval: pd.DataFrame  # ``dashboards.statistics.retrieval_rates.summarise_retrieval``
    claims: list[Claim]
    # the claims by the other method: the paper's, or the product's; empty if not measured
    others: list[Claim]


def report_run(data: str, settings: RunSettings) -> Report:
    """Write tables, charts and the page into a run's folder; StorageError if the run has no rows."""
    run = run_folder(data, settings)
    attempts = read_attempts(run.results, NOT_NEEDED)
    check_verified(attempts)
    continual = continual_rows(data, settings, attempts)
    summary, recalls = summarise(attempts), _recall_rows(data, settings)
    judged = claims(Evidence(attempts, recalls, continual))
    report = Report(summary, report_retrieval(data, settings), judged, claims_by_other(data, settings))
    _write(run.summary("csv"), as_csv(summary))
    judgement = claims_markdown(report.claims, report.others)
    short = shortfalls(data, settings)
    texts = [
        "\n".join(map(str, short)),
        findings_markdown(summary),
        summary_markdown(summary),
        retrieval_markdown(report.retrieval),
        judgement,
    ]
    _write(run.summary("md"), "\n".join(texts))
    drawn, found = as_found(summary), as_found(attempts)  # a polish would hide what planners and recall take
    figures = {
        "planning-times": planning_times(drawn),
        "controls": controls(drawn),
        "solved-against-time": solved_against_time(solved_curve(found)),
        "performance-profile": performance_profile(profile_curve(found)),
        "time-split": time_split(split_of(found)),
    }
    if (summary["recall"] == "random").any():
        figures["ablation"] = ablation(drawn)
    if len(continual):
        figures["continual-improvement"] = continual_improvement(summarise_continual(continual))
    for name, figure in figures.items():
        save(figure, run.figures, name)
    made_by = {name: distinct_values(run.results, name) for name in ("host", "commit")}
    _write(run.report, page_of(run, settings, attempts, *report, made_by, short))
    return report


def check_verified(attempts: pd.DataFrame) -> None:
    """Refuse ``attempts`` if one counts as solved with a plan that the authority did not accept.

    Raises:
        StorageError: there is such an attempt.
    """
    wrong = attempts[is_unaccepted(attempts)]
    if len(wrong):
        first = wrong.iloc[0]
        raise StorageError(
            f"{len(wrong):,} of {len(attempts):,} attempts count as solved with plans that the authority did "
            f"not accept; the first: {first['problem_id']} by {first['planner']}, {first['assist']} "
            f"{first['top_k']}. No report is made from them."
        )


def claims_by_other(data: str, settings: RunSettings) -> list[Claim]:
    """The claims as decided by a run with the other method, the paper's or the product's.

    Args:
        data: the data folder.
        settings: those of the run that is reported.

    Returns:
        the claims by the run of that folder with the same classes, vehicle, difficulty and seed and the most
        experiences and test problems; none if there is no such run.
    """
    found = []
    for run, other in _runs_with_rows(data):
        alike = all(getattr(other, name) == getattr(settings, name) for name in ALIKE)
        if alike and other.as_published != settings.as_published:
            found.append((other.experiences, other.test_problems, run.path.name, other))
    if not found:
        return []
    other = max(found, key=lambda each: each[:3])[-1]
    with suppress(StorageError):  # some of its files are missing
        attempts = read_attempts(run_folder(data, other).results, NOT_NEEDED)
        return claims(Evidence(attempts, _recall_rows(data, other), continual_rows(data, other, attempts)))
    return []


def _runs_with_rows(data: str) -> Iterator[tuple[RunFolder, RunSettings]]:
    """The runs of a data folder that have results, with their settings."""
    for run in open_data_folder(data).runs():
        if is_there(run.settings) and is_there(run.results):
            with suppress(StorageError):  # of another version, or edited
                yield run, recorded_settings(run)


def continual_rows(data: str, settings: RunSettings, attempts: pd.DataFrame) -> pd.DataFrame:
    """The attempts of all runs that differ from this one only in their number of experiences.

    Runs may also differ in what they measured. A planner on a class is included if runs with several numbers
    of experiences measured it, and so is the combined memory.

    Args:
        data: the data folder.
        settings: those of the run.
        attempts: the attempts of the run.

    Returns:
        attempts, with the column ``experiences``; none if all runs have the same number.
    """
    own = run_folder(data, settings)
    results: dict[int, Path] = {}  # by number of experiences
    for run, other in _runs_with_rows(data):
        if run.path == own.path:
            continue
        may_differ = {name: getattr(settings, name) for name in MAY_DIFFER}
        if replace(other, **may_differ) == settings and other.experiences != settings.experiences:
            results.setdefault(other.experiences, run.results)
    if not results:
        return pd.DataFrame()
    tables = {count: read_attempts(path, NOT_NEEDED) for count, path in results.items()}
    by_others = pd.concat([table[MEASURED_ON].drop_duplicates() for table in tables.values()])
    shared = pd.MultiIndex.from_frame(by_others.drop_duplicates())
    tables[settings.experiences] = attempts[pd.MultiIndex.from_frame(attempts[MEASURED_ON]).isin(shared)]
    rows = pd.concat(
        [table.assign(experiences=count) for count, table in sorted(tables.items())], ignore_index=True
    )
    combined = rows["memory"] == COMBINED
    if rows.loc[combined, "experiences"].nunique() < 2:
        rows = rows[~combined]
    measured = rows.groupby(MEASURED_ON)["experiences"].transform("nunique")
    return rows[measured > 1]


def report_retrieval(data: str, settings: RunSettings) -> pd.DataFrame:
    """Write the table and the chart of what the memories recall, and return the table."""
    run = run_folder(data, settings)
    curve = retrieval_curve(_recall_rows(data, settings))
    retrieval = summarise_retrieval(curve)
    _write(run.retrieval, as_csv(retrieval))
    save(retrieval_curves(curve), run.figures, "retrieval")
    return retrieval


def _recall_rows(data: str, settings: RunSettings) -> pd.DataFrame:
    return read_recalls([chunk.shard("recalls") for chunk in MEASURE_RECALL.chunks(data, settings)])


def log_tables(report: Report, run: RunFolder) -> None:
    """Log the tables of a report, how long each stage took, and finally the findings in words."""
    for table in summary_tables(report.summary):
        _LOG.info(table)
    log_retrieval(report.retrieval)
    _LOG.info(stages_table(stage_cells(stages_of(run))))
    for found in findings(report.summary):
        _LOG.info(f"{fill(f'{found.panel}: {found.text} {found.others}', LINE)}\n")


def log_retrieval(retrieval: pd.DataFrame) -> None:
    """Log what the memories recall."""
    _LOG.info(retrieval_table(retrieval))


def log_variants(chunks: Iterable[Chunk]) -> None:
    """Log how well each variant of a sweep ranks plans."""
    _LOG.info(sweep_table(sweep_rows(chunks)))


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
