"""The main job, small: same rows however many workers, nothing done twice, all of it verified and tracked."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections import Counter
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.cli.main import call
from planners.attempt import WITHOUT_MEMORY
from planners.search.registry import PLANNERS
from storage.archives.memories import load_memory
from storage.places.data_folder import DataFolder
from storage.places.run_folder import RunFolder
from storage.tables.recalls import read_recalls
from tasks.reports.stage_times import stages_of
from tasks.settings.presets import for_preset
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import UNASSISTED
from tasks.stages.collect_gained import COLLECT_GAINED
from tests.flows.conftest import SmallRuns
from tests.flows.same_rows import assert_same_rows, rows_of
from tests.flows.small_run import COLLECTING, LATER

pytestmark = pytest.mark.timeout(600)  # whoever comes first makes the runs, on a machine that may be busy


@pytest.fixture(scope="module")
def runs(small_runs: SmallRuns) -> tuple[RunFolder, RunFolder]:
    """Folders of the same run with two workers and in one process."""
    return small_runs.two, small_runs.one


def test_one_process_and_two_workers_give_the_same_rows_but_for_times(
    runs: tuple[RunFolder, RunFolder],
) -> None:
    assert len(assert_same_rows(*runs)) > 12


def test_one_process_and_two_workers_give_the_same_memories(runs: tuple[RunFolder, RunFolder]) -> None:
    two, one = runs
    for name in ("random", "trap", "combined"):
        ours, theirs = (load_memory(run.memory(name)) for run in (two, one))
        for tensor in ("centroids", "vectors", "biases"):
            assert np.array_equal(getattr(ours, tensor), getattr(theirs, tensor))


def test_every_configuration_meets_every_problem(runs: tuple[RunFolder, RunFolder]) -> None:
    rows = pd.concat([rows_of(path) for path in sorted(runs[0].results.rglob("*.parquet"))])
    way = ["problem_class", "planner", "assist", "recall", "top_k", "polished"]
    asked = rows.groupby(way, dropna=False)["problem_id"].nunique()
    assert (asked == 6).all()
    settings = for_preset("smoke")
    picked = len(settings.ablation)
    ways = [UNASSISTED.name] * len(PLANNERS)
    ways += [assist.name for planner in PLANNERS for assist in settings.assists_of(planner)]
    assert len(asked) == 2 * (len(ways) + picked)
    counts = Counter(rows["memory"].fillna("none"))
    alone = sum(name in WITHOUT_MEMORY for name in ways)
    guided = len(ways) - alone
    of_class = 6 * (guided + picked)
    assert counts == {"none": 12 * alone, "random": of_class, "trap": of_class, "combined": 12 * guided}
    assert rows.loc[rows["solved"], "verified"].all()


def test_collected_problems_are_never_tested_with(runs: tuple[RunFolder, RunFolder]) -> None:
    collected = {
        identity for path in runs[0].shards("candidates", "trap") for identity in rows_of(path)["id"]
    }
    tested = set(rows_of(runs[0].shard("results", "trap", 0))["problem_id"])
    assert collected
    assert tested
    assert not collected & tested


def test_the_same_command_again_does_nothing_again(runs: tuple[RunFolder, RunFolder]) -> None:
    settings, data = recorded_settings(runs[0]), str(runs[0].path.parents[1])
    for stage in (*COLLECTING, *LATER):
        chunks = stage.chunks(data, settings)
        assert chunks or stage is COLLECT_GAINED  # nothing was learned at work
        assert all(stage.kept(chunk) for chunk in chunks)


def test_recall_is_measured_for_each_memory_seed_and_protocol(runs: tuple[RunFolder, RunFolder]) -> None:
    run = runs[0]
    rows = read_recalls(
        [path for name in ("random", "trap", "combined") for path in run.shards("recalls", name)]
    )
    asked = rows.groupby(["memory", "class", "protocol", "recall", "training_seed"])["problem_id"].nunique()
    assert set(asked.index.droplevel([2, 3, 4])) == {
        ("random", "random"), ("trap", "trap"), ("combined", "random"), ("combined", "trap")
    }  # fmt: skip
    ways = [("encoder", 0), ("encoder", 1), ("mask", 0), ("popularity", 0)]
    assert (asked.groupby(level=[0, 1, 2]).size() == len(ways)).all()
    assert (asked.xs("fresh", level="protocol") == 6).all()
    held_out = rows[rows["protocol"] == "held-out"]
    assert (rows.loc[rows["protocol"] == "fresh", "made_for"] == -1).all()
    assert all(free[made_for] for free, made_for in zip(held_out["free"], held_out["made_for"], strict=True))
    plans = {"random": range(4), "trap": range(4, 8)}  # of the combined memory, class by class
    combined = held_out[held_out["memory"] == "combined"]
    assert all(
        made in plans[name] for name, made in zip(combined["class"], combined["made_for"], strict=True)
    )
    assert "origin@1" in (run.path / "retrieval.csv").read_text()


def test_mlflow_has_one_parent_and_its_children(runs: tuple[RunFolder, RunFolder]) -> None:
    with sqlite3.connect(runs[0].path.parents[1] / "mlflow.db") as database:
        tags = database.execute("SELECT run_uuid, key, value FROM tags").fetchall()
        metrics = {name for (name,) in database.execute("SELECT DISTINCT key FROM metrics")}
        inputs = database.execute("SELECT count(*) FROM datasets").fetchone()[0]
        models = database.execute("SELECT name, source_run_id FROM logged_models").fetchall()
    stages = {run: value for run, key, value in tags if key == "motion_memory.stage"}
    parents = {run: value for run, key, value in tags if key == "mlflow.parentRunId"}
    (parent,) = [run for run, stage in stages.items() if stage == "run"]
    trained = [f"train {name} seed {seed}" for name in ("combined", "random", "trap") for seed in (0, 1)]
    children = ["benchmark", *trained]
    assert sorted(stages.values()) == sorted([*children, "run"])
    assert parents == {run: parent for run in stages if run != parent}
    assert {"loss", "hit_1", "hit_5", "trap/gust/none/mean_ms"} <= metrics
    assert inputs == 9  # what each of six trainings and the benchmark rest on, and two classes' experiences
    assert sorted(name for name, _ in models) == [
        f"motion-memory-{name}" for name in ("combined", "random", "trap")
    ]
    assert {stages[run].split()[1] for _, run in models} == {"combined", "random", "trap"}


def test_mlflow_compares_runs_by_one_name_a_setting_and_the_same_figures(
    runs: tuple[RunFolder, RunFolder],
) -> None:
    with sqlite3.connect(runs[0].path.parents[1] / "mlflow.db") as database:
        (parent,) = database.execute("SELECT run_uuid FROM tags WHERE value = 'run'").fetchone()
        asked = "SELECT key, value FROM {} WHERE run_uuid = ?"
        parameters = dict(database.execute(asked.format("params"), (parent,)).fetchall())
        figures = dict(database.execute(asked.format("latest_metrics"), (parent,)).fetchall())
    settings = {
        "objective": "labels",
        "experiences": "4",
        "hallucination": "rearrange 1",
        "learning.seeds": "2",
    }
    assert settings.items() <= parameters.items()
    wanted = {"1-gain/faster", "3-alone/solved", "4-recall/oracle", "5-saved/open-5-exhaustive"}
    assert len([name for name in figures if not name.startswith("system/")]) <= 32
    assert wanted <= set(figures)
    assert 0.0 <= figures["4-recall/hit_1"] <= figures["4-recall/oracle"] <= 1.0


FIGURES = {
    "planning-times", "controls", "ablation", "solved-against-time", "performance-profile", "time-split",
    "retrieval", "problems-trap", "training-combined",
}  # fmt: skip


def test_the_report_is_there(runs: tuple[RunFolder, RunFolder]) -> None:
    drawn = {path.name for path in runs[0].figures.iterdir()}
    assert {"planning-times.png", "retrieval.png", "problems-trap.png", "training-combined.png"} <= drawn
    assert {"embeddings-trap.png", "embeddings-combined.png"} <= drawn
    assert "follow" in runs[0].summary("md").read_text()
    html = runs[0].report.read_text()
    assert all(f'<figure id="{name}">' in html for name in FIGURES)
    assert html.count('<div class="claim') == 19
    assert all(f"<dt>{name}</dt>" in html for name in ("commit", "host", "benchmark", "seed", "numba"))


def test_every_stage_is_on_record(runs: tuple[RunFolder, RunFolder]) -> None:
    records = stages_of(runs[0])
    stages = ["collect", "hallucinate", "train", "build_memory", "benchmark", "report"]
    assert [record["stage"] for record in records] == stages
    assert all(record["seconds"] > 0.0 and record["versions"]["numpy"] for record in records)


def test_every_figure_is_an_artifact_in_mlflow_and_prefect(runs: tuple[RunFolder, RunFolder]) -> None:
    data = runs[0].path.parents[1]
    logged = {path.relative_to(path.parents[1]) for path in (data / "mlartifacts").rglob("*.*")}
    assert {Path("figures") / f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")} <= logged
    assert Path("artifacts/report.html") in logged
    with closing(sqlite3.connect(data / "prefect" / "prefect.db")) as database:
        found = database.execute("SELECT DISTINCT key, type FROM artifact").fetchall()
    kinds = {str(key).removeprefix(f"{runs[0].path.name}-"): kind for key, kind in found if key}
    assert {name: kinds[name] for name in FIGURES} == dict.fromkeys(FIGURES, "image")
    assert (kinds["report"], kinds["summary"], kinds["claims"]) == ("markdown", "markdown", "table")


def test_the_log_of_a_run_in_prefect_holds_what_was_told_and_nothing_else(
    runs: tuple[RunFolder, RunFolder],
) -> None:
    data = runs[0].path.parents[1]
    with closing(sqlite3.connect(data / "prefect" / "prefect.db")) as database:
        lines = database.execute("SELECT name, message FROM log WHERE flow_run_id IS NOT NULL").fetchall()
    assert {name.partition(".")[0] for name, _ in lines} == {"tasks"}
    assert sum("Retrieval" in message for _, message in lines) == 1  # not at its stage and in the report


def test_verify_finds_no_fault_and_then_the_one_that_is_planted(
    runs: tuple[RunFolder, RunFolder], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(runs[1].path.parents[1], folder)
    (run,) = DataFolder(folder).runs()
    asked = ["verify", str(folder), "--workers", "1", "--sample"]
    assert call([*asked, "1", "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    attempts = sum(len(rows_of(path)) for path in run.results.rglob("*.parquet"))
    assert json.loads(printed.out)["answer"]["checked"]["attempts made again"] == attempts
    damaged = run.memory("trap") / "encoder.safetensors"
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"!")
    assert call([*asked, "0"]) == 1
    assert "encoder.safetensors is damaged" in capsys.readouterr().err
