"""Continual improvement: the run itself with fewer experiences, and nothing where none is asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from flows.run import run as run_flow
from tasks.settings.errors import UsageError
from tasks.settings.fewer_experiences import runs_of_continual
from tasks.settings.presets import for_preset


def test_the_paper_measures_gust_on_curves_with_20_40_60_and_80_experiences() -> None:
    settings = for_preset("paper")
    runs = runs_of_continual(settings)
    assert [run.experiences for run in runs] == [20, 40, 60, 80]
    assert [run.candidates for run in runs] == [200, 400, 600, 800]
    assert all(run.classes == ("curves",) and run.planners == ("gust",) for run in runs)
    assert all(run.test_problems == settings.test_problems and run.seed == settings.seed for run in runs)


def test_all_measures_what_the_run_measures_but_with_fewer_experiences() -> None:
    settings = for_preset("laptop", continual="all")
    for run in runs_of_continual(settings):
        asked = replace(run, experiences=100, candidates=settings.candidates, continual="all")
        assert asked == settings


@pytest.mark.parametrize("asked", [{"continual": "none"}, {"classes": ["trap"]}, {"planners": ["rrt"]}])
def test_no_run_is_made_where_there_is_nothing_to_measure(asked: dict[str, object]) -> None:
    assert runs_of_continual(for_preset("paper", **asked)) == []  # type: ignore[arg-type]


def test_too_few_experiences_are_refused_in_one_line() -> None:
    with pytest.raises(UsageError, match=r"4 experiences: give 5 or more"):
        runs_of_continual(for_preset("smoke", experiences=4, continual="all"))


def test_what_is_measured_beside_a_run_does_not_change_its_name() -> None:
    assert for_preset("paper", continual="all").run_name == for_preset("paper").run_name


def test_a_run_with_too_few_is_refused_before_it_begins(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"4 experiences: give 5 or more"):
        run_flow.fn(for_preset("smoke", experiences=4, continual="all"), str(tmp_path))
    assert not list(tmp_path.rglob("*.parquet"))


@pytest.mark.parametrize("continual", ["all", "paper", "none"])
def test_a_retraining_is_not_measured_with_fewer_and_takes_its_own_snapshot(continual: str) -> None:
    settings = for_preset("smoke", experiences=4, continual=continual)
    assert settings.for_retraining() == for_preset("smoke", experiences=4, continual="none")
    with pytest.raises(UsageError, match="--learned cannot be used"):
        replace(settings, learned="monday").for_retraining()
