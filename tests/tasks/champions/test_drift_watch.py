"""Watching: an event is sent when hits have fallen, exactly then, and to whoever is there to be told."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pandas as pd
import pytest
from prefect.server.events.schemas.events import Resource, ResourceSpecification

from dashboards.cells import NOTHING
from dashboards.verdicts.drift import FEWEST, Drift, Usefulness, drifts
from dashboards.web.pages.retraining_charts import watched_charts, watched_rows
from planners.attempt import DRIVES, SUB_PLANS
from storage.places.data_folder import open_data_folder
from storage.tables.attempts import write_attempts
from storage.tables.configurations import Configuration
from storage.tables.schemas import ATTEMPTS
from storage.tables.watched import add_watched, read_watched
from tasks.champions import drift_watch as task
from tasks.champions.drift_watch import (
    DRIFT,
    KIND,
    LIBRARY,
    RESOURCE,
    RESOURCE_OF,
    RUN,
    SOLVED,
    BenchmarkedMemory,
    benchmarked_memory,
    report_drift,
    usefulness_at_work,
)
from tasks.champions.retraining_schedule import RUNS
from tasks.registry.champion_registry import Version
from tests.dashboards.synthetic import attempts

NAME = "gust open 5 exhaustive"
THEN = Usefulness(500, hits=400, mean_ms=1.0, median_ms=0.1, solved=500, total_s=21.0, total_sd_s=2.0)
BENCHMARKED = BenchmarkedMemory("motion-memory-trap/2", {NAME: THEN}, Path("nowhere"))
FALLEN = replace(THEN, problems=200, hits=90)
LATER = replace(THEN, total_s=26.0)


class Sent:
    """Who takes down what would be sent."""

    def __init__(self) -> None:
        self.events: list[str] = []

    def __call__(self, url: str, events: Sequence[tuple[str, Drift]], kind: str) -> None:
        self.events += [name for name, _ in events]


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> Sent:
    told = Sent()
    monkeypatch.setattr(task, "_send", told)
    monkeypatch.setenv("PREFECT_API_URL", "http://prefect.example/api")
    return told


@pytest.mark.parametrize(
    ("problems", "hits", "events"),
    [(200, 160, [SOLVED]), (200, 150, [SOLVED]), (200, 90, [SOLVED, DRIFT]), (10, 0, [SOLVED])],
)
def test_drift_is_told_exactly_when_hits_have_fallen(
    sent: Sent, problems: int, hits: int, events: list[str]
) -> None:
    lines = report_drift(BENCHMARKED, {NAME: replace(THEN, problems=problems, hits=hits)}, None)
    assert sent.events == events
    assert (f"event {DRIFT} sent to http://prefect.example/api" in lines) == (DRIFT in events)
    assert lines[0].startswith("motion-memory-trap/2, gust open 5 exhaustive: ")


def test_drift_is_told_when_robots_are_there_later(sent: Sent) -> None:
    report_drift(BENCHMARKED, {NAME: LATER}, None)
    assert sent.events == [SOLVED, DRIFT]


@pytest.mark.parametrize("hits", [38, 0])
@pytest.mark.parametrize("others_first", [False, True])
def test_problems_of_another_kind_in_the_same_file_change_nothing(
    sent: Sent, tmp_path: Path, hits: int, others_first: bool
) -> None:
    ranked = attempts(("trap",), ("gust",), [Configuration("open", "exhaustive", 5)], problems=40)
    ranked["hit"] = [number < hits for number in range(len(ranked))]
    others = [ranked.assign(recall=recall, hit=False, duration_s=90.0) for recall in (DRIVES, SUB_PLANS)]
    mixed = [*others, ranked] if others_first else [ranked, *others]
    told = []
    for name, tables in (("alone", [ranked]), ("mixed", mixed)):
        table = pd.concat(tables).astype(object)
        rows = table.where(table.notna(), None).to_dict("records")
        blank = dict.fromkeys(ATTEMPTS.names)
        write_attempts(tmp_path / f"{name}.parquet", [blank | row for row in rows])
        told.append(
            report_drift(BENCHMARKED, usefulness_at_work(BENCHMARKED, tmp_path / f"{name}.parquet"), None)
        )
    assert told[0] == told[1]
    assert sent.events == [SOLVED, *([DRIFT] * (hits == 0))] * 2


def test_nothing_is_told_of_what_no_benchmark_knows(sent: Sent) -> None:
    assert report_drift(BENCHMARKED, {"rrt open 5 exhaustive": FALLEN}, None) == []
    assert sent.events == []


def test_with_nobody_to_tell_it_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    monkeypatch.setenv("MOTION_MEMORY_DATA", str(tmp_path))
    lines = report_drift(BENCHMARKED, {NAME: FALLEN}, tmp_path)
    assert lines[-1] == "no Prefect server received the event: `motion-memory serve` runs one"
    assert report_drift(BENCHMARKED, {NAME: THEN}, tmp_path)[1:] == []
    assert list(tmp_path.iterdir()) == []


def test_what_was_seen_is_kept_in_the_data_folder_of_the_memory(sent: Sent, tmp_path: Path) -> None:
    data = open_data_folder(tmp_path / "data")
    memory = BENCHMARKED._replace(data_folder=data.path)
    report_drift(memory, {NAME: FALLEN}, None)
    report_drift(memory, {NAME: THEN}, None)
    report_drift(memory, {"rrt open 5 exhaustive": THEN}, None)  # of which its benchmark says nothing
    (data.watched / "20000101T000000-0.parquet").write_bytes(b"no table")
    seen, (fault,) = read_watched(data.watched)
    assert "not a complete Parquet file" in fault
    assert seen["at"].is_monotonic_increasing
    assert sorted(zip(seen["problems"], seen["hits"], seen["has_fallen"], strict=True)) == [
        (200, 90, True),
        (500, 400, False),
    ]
    assert set(seen["benchmark_hits"]) == {400}


def test_what_an_earlier_version_saw_is_shown_beside_the_rest(tmp_path: Path) -> None:
    (row,) = (each.to_row() for each in drifts("trap/2", {NAME: LATER}, {NAME: THEN}))
    earlier = {name: row[name] for name in row if not re.search("total|later", name)} | {"has_fallen": True}
    add_watched(tmp_path, [earlier])
    add_watched(tmp_path, [row])
    seen, faults = read_watched(tmp_path)
    assert faults == []
    shown = {(each["total_s"], each["verdict"]) for each in watched_rows(seen)}
    assert shown == {("21.0→26.0", "later"), (NOTHING, "fewer hits")}
    assert list(watched_charts(seen))


def test_a_page_says_of_few_problems_that_they_are_too_few(tmp_path: Path) -> None:
    few = replace(THEN, problems=FEWEST - 1, hits=0)
    add_watched(tmp_path, [each.to_row() for each in drifts("trap/2", {NAME: few}, {NAME: THEN})])
    seen, _ = read_watched(tmp_path)
    assert [each["verdict"] for each in watched_rows(seen)] == ["too few to say"]


def test_who_cannot_be_told_breaks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> None:
        raise OSError("connection refused")

    monkeypatch.setattr(task, "_send", gone)
    monkeypatch.setenv("PREFECT_API_URL", "http://prefect.example/api")
    assert report_drift(BENCHMARKED, {NAME: FALLEN}, None)[-1].endswith("connection refused")


def test_the_benchmark_of_a_registered_version_is_in_its_tags(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    data = open_data_folder(tmp_path / "data")
    monkeypatch.setenv("MOTION_MEMORY_DATA", str(data.path))
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    version = Version("motion-memory-trap", 2, {"benchmark": json.dumps({NAME: asdict(THEN)})})
    monkeypatch.setattr(task.Registry, "aliased", lambda *_: version)
    monkeypatch.setattr(task.Registry, "versions", lambda *_: [version])
    memory = BENCHMARKED._replace(data_folder=data.path)
    assert benchmarked_memory("models:/motion-memory-trap@champion") == memory
    assert benchmarked_memory("models:/motion-memory-trap/2") == memory
    assert benchmarked_memory("models:/motion-memory-trap/1") is None
    assert benchmarked_memory("models:/motion-memory-trap/latest") is None
    assert benchmarked_memory(str(tmp_path / "memories" / "trap")) is None
    assert benchmarked_memory(None) is None


@pytest.mark.parametrize(
    ("drifting", "told"),
    [
        (RUNS, {"motion-memory-trap/1"}),
        ({RESOURCE: f"{RESOURCE_OF}motion-memory-yards/*"}, {"motion-memory-yards/2"}),
    ],
)
def test_a_retraining_is_started_by_drift_of_what_it_retrains(
    drifting: dict[str, str], told: set[str]
) -> None:
    memories = {
        "motion-memory-trap/1": RUN,
        "motion-memory-yards/2": LIBRARY,
        "motion-memory-yards-bus/1": LIBRARY,
    }
    wanted = ResourceSpecification({**drifting})
    assert {
        name
        for name, kind in memories.items()
        if wanted.matches(Resource({RESOURCE: f"{RESOURCE_OF}{name}", KIND: kind}))
    } == told
