"""What the page on scale is made by: costs read from a run's folder, and multiplied."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from storage.places.run_folder import RunFolder
from tests.speed.scale import BASE_BYTES, TASK_BYTES, Cost, costs_of, markdown, projected


def a_run(folder: Path) -> RunFolder:
    """A run of 2 classes: 100 candidates, 400 problems, as many for the combined memory, 40 attempts."""
    for name, rows in (
        ("candidates/a/0000", 50),
        ("candidates/b/0000", 50),
        ("hallucinated/a/0000", 300),
        ("hallucinated/b/0000", 100),
        ("hallucinated/combined/0000", 400),
        ("results/a/0000", 40),
    ):
        path = folder / f"{name}.parquet"
        path.parent.mkdir(parents=True)
        pq.write_table(pa.table({"x": list(range(rows))}), path)
    loads = {
        "collect": ("collect", 2, 5.0, 0),
        "hallucinate": ("hallucinate", 2, 8.0, 0),
        "train": ("train, epochs of a class", 3, 16.0, BASE_BYTES + 4_000),
        "benchmark": ("benchmark", 1, 2.0, 0),
        "report": ("nothing known", 1, 2.0, 0),
    }
    records = [
        {
            "stage": stage,
            "fan_outs": [{"what": what, "chunks": chunks, "busy_seconds": busy, "last_bytes": last}],
        }
        for stage, (what, chunks, busy, last) in loads.items()
    ]
    (folder / "stages.json").write_text(json.dumps(records))
    return RunFolder(folder)


def test_costs_are_what_workers_took_by_what_they_left(tmp_path: Path) -> None:
    costs = {cost.stage: cost for cost in costs_of(a_run(tmp_path), epochs=10)}
    assert list(costs) == ["collect", "hallucinate", "train", "benchmark"]
    assert costs["collect"].seconds == pytest.approx(5.0 / 100)
    assert costs["hallucinate"].seconds == pytest.approx(8.0 / 400)  # not those of the combined memory again
    assert costs["train"].seconds == pytest.approx(16.0 / (10 * 800))
    assert costs["train"].held == pytest.approx(4_000 / 400)
    assert (costs["hallucinate"].chunk, costs["train"].chunk) == (200, 0)
    sizes = [file.stat().st_size for name in "ab" for file in tmp_path.glob(f"hallucinated/{name}/*")]
    assert costs["hallucinate"].stored == pytest.approx(sum(sizes) / 400)


def test_ten_times_as_many_take_ten_times_as_much() -> None:
    cost = Cost("s", "u", 3.6e-3, 2_000.0, 500, 0.0)
    assert projected(cost, 10**8)[1:3] == ["4 days", "200 GB"]
    assert projected(cost, 10**9)[1:3] == ["42 days", "2 TB"]
    assert projected(cost, 10**8)[3] == "200,000"
    assert projected(cost, 10**8)[5] == f"{200_000 * TASK_BYTES / 1e9:.3g} GB"


def test_the_tables_have_a_row_a_stage_and_size() -> None:
    lines = markdown([Cost("s", "u", 1e-3, 10.0, 5, 0.0), Cost("t", "v", 1e-3, 0.0, 0, 500.0)]).splitlines()
    assert len(lines) == (2 + 2) + 1 + (2 + 2 * 3)
    assert all(line.count("|") == lines[0].count("|") for line in lines[:4])
    assert lines[-1].endswith("| 5 TB |")
