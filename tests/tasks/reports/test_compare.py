"""Comparing folders of runs: what is told, what is written, what is refused."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from dashboards.cells import CellTable
from storage.errors import StorageError
from storage.places.files import write_json
from storage.places.run_folder import RunFolder
from storage.tables.attempts import write_attempts
from tasks.reports.compare import compare
from tasks.settings.errors import UsageError
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings
from tests.storage.tables.test_tables import ATTEMPT


def _run(place: Path, settings: RunSettings, seconds: float, problem: str = "p", checks: int = 100) -> Path:
    run = RunFolder(place)
    write_json(run.settings, json.loads(settings.to_json()))
    rows = [
        {
            **ATTEMPT,
            "run_id": settings.run_name,
            "problem_id": f"{problem}-{i}",
            "planning_seconds": seconds if assist == "closed" else 0.1,
            "collision_checks": checks if assist == "closed" else 100,
            "assist": assist,
            "top_k": 5 if assist == "closed" else 0,
            "recall": "encoder" if assist == "closed" else None,
            "memory": "curves" if assist == "closed" else None,
        }
        for i in range(9)
        for assist in ("none", "closed")
    ]
    write_attempts(run.shard("results", "curves", 0), rows)
    return place


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    labels = for_preset("smoke")
    triplet = replace(labels, objective="triplet", learning=replace(labels.learning, margin=2.0))
    return [_run(tmp_path / "one", labels, 0.02), _run(tmp_path / "two", triplet, 0.01)]


def test_a_comparison_is_not_written_over_the_settings_of_a_run(runs: list[Path]) -> None:
    before = (runs[1] / "settings.json").read_bytes()
    with pytest.raises(UsageError, match="is read"):
        compare(runs, runs[1] / "settings.json")
    assert (runs[1] / "settings.json").read_bytes() == before


def test_runs_are_compared_and_what_differs_is_said(runs: list[Path], tmp_path: Path) -> None:
    for ending in ("json", "md", "csv"):
        said = "\n".join(map(str, compare(runs, tmp_path / f"c.{ending}").told()))
    assert "two against one: 0 better, 0 worse, 1 no difference of 1 configurations" in said
    found = json.loads((tmp_path / "c.json").read_text())
    assert found["settings"] == {
        "objective": {"one": '"labels"', "two": '"triplet"'},
        "learning.margin": {"one": "1.0", "two": "2.0"},
    }
    (closed,) = [row for row in found["runs"]["two"] if row["configuration"] == "closed 5 encoder"]
    assert closed["reduction"] == pytest.approx(0.5)
    assert (closed["verdict"], closed["reduction_low"]) == ("no difference", None)  # times of two days
    assert "one after the other" in (tmp_path / "c.md").read_text()
    with (tmp_path / "c.csv").open(newline="") as text:
        assert [(row["run"], row["first"]) for row in csv.DictReader(text)] == [("two", "one")] * 2


@pytest.mark.parametrize("checks", [100, 5_000])
def test_rows_without_a_difference_are_left_out_and_counted(
    runs: list[Path], tmp_path: Path, checks: int
) -> None:
    other = _run(tmp_path / "other", for_preset("smoke"), 0.02, checks=checks)
    compared = compare([runs[0], other], None)
    verdicts = list(compared.tables["other"]["verdict"])
    differ = sum(each in ("better", "worse") for each in verdicts)
    assert differ == (checks > 100)
    for every, shown in ((True, len(verdicts)), (False, differ)):
        told = list(compared.told(every=every))
        tables = [each for each in told if isinstance(each, CellTable) and each.name == "comparison"]
        assert sum(len(group) for table in tables for group in table.groups) == shown
        assert any("--all" in str(each) for each in told) == (shown < len(verdicts))


def test_runs_of_one_name_are_told_apart_by_their_paths(runs: list[Path], tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    runs[1].rename(tmp_path / "other" / "one")
    compared = compare([runs[0], tmp_path / "other" / "one"], None)
    assert str(tmp_path / "other" / "one") in compared.names


def test_what_cannot_be_compared_is_told_and_nothing_written(runs: list[Path], tmp_path: Path) -> None:
    strange = _run(tmp_path / "three", for_preset("smoke"), 0.01, problem="q")
    out = tmp_path / "c.md"
    with pytest.raises(UsageError, match="1 run to compare"):
        compare(runs[:1], out)
    with pytest.raises(UsageError, match=r"does not end in"):
        compare(runs, tmp_path / "c.txt")
    with pytest.raises(StorageError, match="is not a run"):
        compare([runs[0], tmp_path], out)
    with pytest.raises(StorageError, match="three and one have no attempt at the same problem in common"):
        compare([runs[0], strange], out)
    assert not out.exists()
