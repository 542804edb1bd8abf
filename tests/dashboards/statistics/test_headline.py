"""The figures that runs are told apart by: means of what the tables show, under the same names everywhere."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from dashboards.statistics.headline import headline
from dashboards.statistics.panels import summarise
from dashboards.statistics.retrieval_rates import retrieval_curve, summarise_retrieval
from tests.dashboards import synthetic


@pytest.fixture(scope="module")
def found() -> tuple[pd.DataFrame, pd.DataFrame, dict[str, float]]:
    summary = summarise(synthetic.attempts(("curves", "trap"), ("gust",)), resamples=100)
    retrieval = summarise_retrieval(retrieval_curve(synthetic.recalls(("curves", "trap"))))
    return summary, retrieval, headline(summary, retrieval)


def test_headlines_are_means_of_the_tables(
    found: tuple[pd.DataFrame, pd.DataFrame, dict[str, float]],
) -> None:
    summary, retrieval, figures = found
    closed = summary[summary["configuration"] == "closed 5 encoder"]
    assert figures["5-saved/closed-5-encoder"] == pytest.approx(closed["reduction"].mean())
    assert figures["3-alone/solved"] == pytest.approx(
        summary.loc[summary["configuration"] == "none", "solved"].mean()
    )
    assert 3.0 < figures["1-gain/faster"] < 5.0
    assert len(figures) <= 32  # or a table of runs cannot be read
    assert sorted(figures)[:2] == ["1-gain/faster", "1-gain/sooner_s"]  # what a table shows first
    assert all(len(name) <= 17 for name in figures if not name.startswith("5-"))  # which it does not cut
    fresh = retrieval[(retrieval["protocol"] == "fresh") & (retrieval["recall"] == "encoder")]
    assert figures["4-recall/hit_1"] == pytest.approx(fresh["hit@1"].mean())
    assert 0.6 < figures["5-saved/all"] < 0.9  # memory was made four times as fast


def test_what_answers_gain_as_returned_stands_beside_what_they_gain_as_found() -> None:
    rows = synthetic.attempts(("curves",), ("lattice",), [*synthetic.STANDARD, *synthetic.POLISHED])
    none = summarise_retrieval(retrieval_curve(synthetic.recalls(("curves",))))
    summary = summarise(rows, resamples=100)
    returned = summary[summary["configuration"] == "repair 5 exhaustive polished"]
    figures = headline(summary, none)
    assert figures.pop("1-gain/returned_s") == pytest.approx(returned["sooner_s"].item())
    assert figures == pytest.approx(headline(summarise(rows[~rows["polished"]], resamples=100), none))


def test_names_do_not_depend_on_what_was_measured_and_no_figure_is_no_number(
    found: tuple[pd.DataFrame, pd.DataFrame, dict[str, float]],
) -> None:
    other = headline(
        summarise(synthetic.attempts(("random",), ("rrt", "follow")), resamples=100),
        summarise_retrieval(retrieval_curve(synthetic.recalls(("random",)))),
    )
    assert set(other) == set(found[2])
    assert all(math.isfinite(value) for value in other.values())
