from __future__ import annotations

import contextlib
import io
import re

import pandas as pd
import pytest

from dashboards.cells import CellTable, count, decimal, percent, with_interval
from dashboards.report.retrieval_tables import retrieval_markdown, retrieval_table
from dashboards.report.tables import (
    FULL_HEADINGS,
    NOTHING,
    as_csv,
    driving_cells,
    experience_table,
    full_cells,
    summary_markdown,
    summary_tables,
)
from dashboards.statistics.panels import summarise
from dashboards.statistics.retrieval_rates import retrieval_curve, summarise_retrieval
from flows.cli.terminal import write
from planners.attempt import SOURCES, WITHOUT_MEMORY
from storage.tables.configurations import Configuration
from tests.dashboards.synthetic import ABLATION, STANDARD, attempts, recalls

ALL = [*STANDARD, *ABLATION, Configuration("open", "hybrid", 5)]


def rendered(*tables: CellTable) -> list[str]:
    with contextlib.redirect_stdout(io.StringIO()) as text:
        write(*tables)
    return text.getvalue().splitlines()


def test_the_table_holds_every_planner_configuration_and_class() -> None:
    seen = set()
    panel = planner = ""
    for line in rendered(*summary_tables(summarise(attempts(configurations=ALL), resamples=10))):
        words = line.split()
        if "problems;" in words:
            panel = words[0].rstrip(",")
        elif words and words[0] in {"rrt", "gust", "follow"}:
            planner = words.pop(0)
        named = " ".join(words)
        labels = [each.label for each in ALL if named.startswith(f"{each.label} ")]
        seen |= {(panel, planner, max(labels, key=len))} if labels else set()
    assert seen == {
        (name, planner, each.label)
        for name in ("curves", "random", "trap")
        for planner in ("rrt", "gust", "follow")
        for each in ALL
    }


def test_what_rounds_to_nothing_is_not_negative() -> None:
    row = {
        "assist": "open",
        "driving_s": 20.0,
        "sooner_s": -0.01,
        "sooner_low_s": -0.02,
        "sooner_high_s": 0.0,
    }
    cells = [decimal(-0.01, 1), with_interval(-1e-4, -2e-4, 0.0), *driving_cells(row)]
    assert not re.search(r"-0(\.0)?\b", " ".join(cells))


def test_hits_are_shown_where_there_is_a_memory_and_nowhere_else(attempt_rows: pd.DataFrame) -> None:
    for _, row in summarise(attempt_rows, resamples=10).iterrows():
        cells = dict(zip(FULL_HEADINGS[2:], full_cells(row, 2), strict=True))
        assert (cells["hits %"] == NOTHING) == (row["assist"] in WITHOUT_MEMORY)


def test_no_column_is_cut_however_narrow_the_output() -> None:
    cells = ["lattice", *(f"{i}2345.678 [1{i}.5, 2{i}.5]" for i in range(8)), "worse: for many reasons " * 4]
    headings = ("planner", *(f"heading {i}" for i in range(8)), "verdict")
    text = " ".join(rendered(CellTable("Wide", headings, [[cells]])))
    assert all(cell in text for cell in (*headings, *cells[:-1]))
    assert "…" not in text


@pytest.mark.parametrize("plans", [1, 4, 30])
def test_no_share_of_the_retrieval_table_exceeds_all_however_few_the_plans(plans: int) -> None:
    text = retrieval_markdown(summarise_retrieval(retrieval_curve(recalls(("trap",), plans=plans))))
    shares = [float(share) for share in re.findall(r"\d+\.\d", text)]
    assert shares
    assert max(shares) <= 100.0


@pytest.mark.parametrize("slowness", [1e-4, 1.0, 1e4])
def test_the_tables_fit_110_columns_uncut(slowness: float) -> None:
    rows = attempts(
        ("multiple_bugtraps",),
        configurations=[*ALL, Configuration("random-closed", "random", 5)],
        speed_up=0.3,
    )
    rows["planning_seconds"] *= slowness
    rows["collision_checks"] = (rows["collision_checks"] * slowness).astype(int)
    retrieval = summarise_retrieval(retrieval_curve(recalls(("multiple_bugtraps",))))
    for table in (*summary_tables(summarise(rows, resamples=50)), retrieval_table(retrieval)):
        lines = rendered(table)
        assert max(len(line) for line in lines) <= 110
        assert not any("…" in line for line in lines)


def test_what_was_not_attempted_is_seen_to_be_missing(attempt_rows: pd.DataFrame) -> None:
    missing = (attempt_rows["problem_class"] == "trap") & (attempt_rows["assist"] == "open")
    text = summary_markdown(summarise(attempt_rows[~missing], resamples=10))
    trap = text[text.index("### trap") :].splitlines()
    open_rows = [line for line in trap if "| open" in line]
    assert len(open_rows) == 9
    assert all(line.count(NOTHING) == len(FULL_HEADINGS) - 2 for line in open_rows)


def test_what_readers_look_for_first_stands_before_what_a_narrow_page_cuts() -> None:
    first = [heading.partition(" [")[0] for heading in FULL_HEADINGS[2:8]]
    assert first == [
        "solved %",
        "mean ms",
        "reduction of the mean %",
        "driving s",
        "sooner s",
        "hits %",
    ]


def test_figures_stand_under_their_headings(attempt_rows: pd.DataFrame) -> None:
    row = summarise(attempt_rows, resamples=10).query("assist != 'none'").iloc[0]
    cells = dict(zip(FULL_HEADINGS[2:], full_cells(row, 2), strict=True))
    for heading, name in (("solved %", "solved"), ("slower %", "slower"), ("hits %", "hit")):
        assert cells[heading] == percent(row[name])
    for heading, name in (("mean ms [95 %]", "mean_ms"), ("median ms [95 %]", "median_ms")):
        assert cells[heading].startswith(f"{row[name]:,.2f} [")
    assert cells["driving s"] == decimal(row["driving_s"], 1)
    assert cells["collision checks"] == count(row["collision_checks"])
    for source in SOURCES:
        assert cells[f"{source} %"] == percent(row[source])


def test_markdown_columns_are_aligned(attempt_rows: pd.DataFrame, recall_rows: pd.DataFrame) -> None:
    tables = summary_markdown(summarise(attempt_rows, resamples=10)).split("### ")[1:]
    tables = [table.split("\n\n", 1)[1] for table in tables]
    tables.append(retrieval_markdown(summarise_retrieval(retrieval_curve(recall_rows))))
    for table in tables:
        bars = [[i for i, letter in enumerate(line) if letter == "|"] for line in table.strip().splitlines()]
        assert all(each == bars[0] for each in bars)


def test_csv_reads_back_unrounded(attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows, resamples=10)
    back = pd.read_csv(io.StringIO(as_csv(summary)))
    names = ("panel", "planner", "configuration", "assist", "recall")
    back = back.fillna({"recall": ""}).astype({name: summary[name].dtype for name in names})
    pd.testing.assert_frame_equal(back, summary, rtol=1e-15)


def test_a_class_that_a_smaller_run_left_out_has_an_empty_cell() -> None:
    row = {"hit": 0.5, "low": 0.4, "high": 0.6, "oracle": 0.9}
    of = [("curves", 40, 40), ("trap", 40, 39), ("curves", 20, 20)]
    rows = pd.DataFrame(
        [{"panel": panel, "experiences": asked, "plans": plans, **row} for panel, asked, plans in of]
    )
    (fewer,), (all_of_them,) = experience_table(rows).groups
    assert [fewer[0], all_of_them[0]] == ["20", "40"]
    assert fewer[2] == NOTHING
    assert all_of_them[2] == fewer[1]
