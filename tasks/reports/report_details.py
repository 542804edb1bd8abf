"""The page of a run's report: which pictures it shows, and what it says about how the run was made."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final

import pandas as pd

from dashboards.cells import planner_title
from dashboards.report.report_page import Picture, page
from dashboards.statistics.distributions import endings
from dashboards.verdicts.claim_rules import Claim
from storage.places.mirror import fetch, files_in
from storage.places.run_folder import RunFolder
from tasks.inputs.shortfalls import Shortfall
from tasks.reports.stage_times import stage_cells, stages_of
from tasks.settings.run_settings import RunSettings

CAPTIONS: Final = {  # in the order of the page; other figures follow by name
    "planning-times": "Mean planning time with and without memory",
    "controls": "Mean planning time with the best recall and repair, beside a control",
    "continual-improvement": "Mean planning time as experience grows",
    "experience-curve": "What is recalled as experience grows",
    "ablation": "Plans recalled or picked blindly",
    "solved-against-time": "Problems solved within a time",
    "performance-profile": "Performance profile",
    "time-split": "Where planning time goes",
    "retrieval": "How often a recalled plan is free",
}


def page_of(
    run: RunFolder,
    settings: RunSettings,
    attempts: pd.DataFrame,
    summary: pd.DataFrame,
    retrieval: pd.DataFrame,
    claims: Sequence[Claim],
    others: Sequence[Claim],
    made_by: Mapping[str, Sequence[str]],
    short: Sequence[Shortfall],
) -> str:
    """The page of a run as HTML: its tables, the figures in its folder, and where its rows come from.

    Args:
        run: the run's folder.
        settings: those of the run.
        attempts: the benchmark's attempts.
        summary: planning times, as ``summarise`` gives them.
        retrieval: what the memories recall, as ``summarise_retrieval`` gives it.
        claims: the paper's claims, with a verdict each.
        others: the same for the other method; empty if that was not measured.
        made_by: "host" and "commit", each with all values in the rows.
        short: classes with fewer experiences than wanted.
    """
    problems = attempts["problem_id"].nunique()
    return page(
        f"Motion Memory: {settings.run_name}",
        f"{len(attempts):,} attempts at {problems:,} unseen problems of {', '.join(settings.class_names)}: "
        f"{', '.join(map(planner_title, settings.planners))} without memory and with {settings.experiences} "
        "experiences a class." + "".join(f" {each}" for each in short),
        summary=summary,
        retrieval=retrieval,
        endings=endings(attempts),
        claims=claims,
        others=others,
        pictures=_pictures(run),
        made=_made(run, settings, made_by),
    )


def _pictures(run: RunFolder) -> list[Picture]:
    """Every figure once, as PNG or SVG, whichever is smaller."""
    smaller: dict[str, Path] = {}
    drawn = [fetch(path) for path in files_in(run.figures, "*.[ps][nv]g")]
    for path in sorted(drawn, key=lambda path: path.stat().st_size):
        smaller.setdefault(path.stem, path)
    return [Picture(smaller[name], CAPTIONS.get(name, _words(name))) for name in sorted(smaller, key=_order)]


def _order(name: str) -> tuple[int, str]:
    names = list(CAPTIONS)
    return (names.index(name) if name in names else len(names), name)


def _words(name: str) -> str:
    """A caption from a file's name: ``problems-trap`` is "Problems: trap"."""
    what, _, of = name.partition("-")
    return f"{what.capitalize()}: {of}" if of else what.capitalize()


def _made(
    run: RunFolder, settings: RunSettings, made_by: Mapping[str, Sequence[str]]
) -> dict[str, dict[str, str]]:
    """Where the rows come from: host and commit of the rows themselves, settings, stages, versions."""
    records = stages_of(run)
    rows = {name: ", ".join(values) or "unknown" for name, values in made_by.items()}
    measured = next((each for each in reversed(records) if each["stage"] == "benchmark"), None)
    of_machine = {name: str(measured[name]) for name in ("processor", "system")} if measured else {}
    stages = {
        name: f"{seconds} s; {chunks} chunks by {workers} workers, {between} % of their time between chunks; "
        f"{first} MB a worker after the first chunk, {last} MB after the last"
        for name, seconds, chunks, workers, between, first, last in stage_cells(records)
    }
    return {
        "Rows": {"run": settings.run_name, **rows, **of_machine},
        "Stages": stages or {"times": "not recorded"},
        "Settings": {name: json.dumps(value) for name, value in asdict(settings).items()},
        "Versions": dict(measured["versions"]) if measured else {"versions": "not recorded"},
    }
