from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import pandas as pd
import pytest

from dashboards.verdicts.evidence import PRODUCT, PUBLISHED
from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.files import write_json
from storage.tables.attempts import read_attempts, write_attempts
from tasks.fan_out.chunk import keep_settings
from tasks.reports import report
from tasks.reports.report import check_verified, claims_by_other, continual_rows
from tasks.settings.fewer_experiences import runs_of_continual
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import COMBINED, RunSettings
from tests.dashboards.synthetic import recalls
from tests.storage.tables.test_tables import ATTEMPT

SETTINGS: Final = for_preset("laptop", continual="paper")


def measure(data: Path, settings: RunSettings, memories: Sequence[str] = ()) -> None:
    """Leave a run with one attempt of each planner at each class with its memory, and with others."""
    keep_settings(str(data), settings)
    run = open_data_folder(data).run(settings.run_name)
    for name in settings.classes:
        rows = [
            {**ATTEMPT, "problem_class": name, "planner": planner, "memory": memory}
            for planner in settings.planners
            for memory in (name, *memories)
        ]
        write_attempts(run.shard("results", name, 0), rows)


def grown(data: Path, settings: RunSettings) -> pd.DataFrame:
    own = open_data_folder(data).run(settings.run_name)
    return continual_rows(str(data), settings, read_attempts(own.results))


@pytest.mark.parametrize("said", [False, None])
def test_no_report_is_made_of_plans_that_the_authority_did_not_accept(tmp_path: Path, said: object) -> None:
    attempt = {**ATTEMPT, "polished": False}
    rows = [{**attempt, "verified": True}, {**attempt, "solved": False, "verified": None}]
    write_attempts(tmp_path / "right.parquet", rows)
    check_verified(read_attempts(tmp_path / "right.parquet"))
    write_attempts(tmp_path / "wrong.parquet", [*rows, {**attempt, "verified": said}])
    with pytest.raises(StorageError, match=f"1 of 3 attempts count as solved .* {ATTEMPT['problem_id']} by"):
        check_verified(read_attempts(tmp_path / "wrong.parquet"))


def test_rows_without_an_answer_of_the_authority_pass_only_if_older_than_the_column(tmp_path: Path) -> None:
    unjudged = {**ATTEMPT, "verified": None, "polished": True}
    write_attempts(tmp_path / "unjudged.parquet", [unjudged])
    with pytest.raises(StorageError, match="1 of 1 attempts"):
        check_verified(read_attempts(tmp_path / "unjudged.parquet"))
    old = {**unjudged, "polished": None}
    for rows in ([old], [old, {**unjudged, "verified": True}]):  # alone, or beside later ones
        write_attempts(tmp_path / "old.parquet", rows)
        check_verified(read_attempts(tmp_path / "old.parquet"))


def test_claims_are_judged_a_second_time_by_the_largest_run_of_the_other_method(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "_recall_rows", lambda data, settings: recalls())
    ours, theirs = for_preset("laptop"), for_preset("paper-method-laptop")
    measure(tmp_path, ours)
    assert claims_by_other(str(tmp_path), ours) == []
    for other in (replace(theirs, test_problems=9), theirs, replace(theirs, seed=2, test_problems=10**6)):
        measure(tmp_path, other)
        run = open_data_folder(tmp_path).run(other.run_name)
        problem = {**ATTEMPT, "assist": "published-open", "recall": "centroid", "problem_class": "trap"}
        write_attempts(run.shard("results", "trap", 1), [problem] if other == theirs else [])
    assert {claim.method for claim in claims_by_other(str(tmp_path), ours)} == {PUBLISHED}
    assert {claim.method for claim in claims_by_other(str(tmp_path), theirs)} == {PRODUCT}


def test_growing_experience_is_that_of_the_planners_and_classes_that_several_runs_measured(
    tmp_path: Path,
) -> None:
    for fewer in runs_of_continual(SETTINGS):
        measure(tmp_path, fewer)
    measure(tmp_path, SETTINGS, [COMBINED])
    rows = grown(tmp_path, SETTINGS)
    assert rows["experiences"].tolist() == [20, 40, 60, 80, 100]
    assert set(rows["planner"]) == {"gust"}
    assert set(rows["memory"]) == {"curves"}


def test_growing_experience_of_all_that_a_run_measures(tmp_path: Path) -> None:
    settings = replace(SETTINGS, continual="all")
    for each in [*runs_of_continual(settings), settings]:
        measure(tmp_path, each)
    rows = grown(tmp_path, settings)
    assert (rows.groupby(["problem_class", "planner"])["experiences"].nunique() == 5).all()
    assert len(rows) == 5 * len(SETTINGS.classes) * len(SETTINGS.planners)


@pytest.mark.parametrize("other", [{"seed": 2}, {"difficulty": "hard"}, {"objective": "triplet"}, {}])
def test_runs_that_differ_in_more_are_not_compared(tmp_path: Path, other: dict[str, object]) -> None:
    measure(tmp_path, SETTINGS)
    if other:
        measure(tmp_path, replace(SETTINGS, experiences=20, **other))  # type: ignore[arg-type]
    old = open_data_folder(tmp_path).run("laptop-of-another-version")
    write_json(old.settings, {"preset": "laptop", "gone": 1})
    write_attempts(old.shard("results", "curves", 0), [ATTEMPT])
    assert grown(tmp_path, SETTINGS).empty
