from __future__ import annotations

import inspect
from pathlib import Path
from typing import get_type_hints

import pytest

from storage.places.data_folder import open_data_folder
from tasks.reports.stage_times import machine, stage_cells, stage_seconds, stages_of, timed
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings


@timed
def collect(settings: RunSettings, data: str) -> None:
    """A stage that does nothing, or fails."""
    if settings.strict:
        raise RuntimeError("a bad world")


def test_each_time_a_stage_ends_is_a_record(tmp_path: Path) -> None:
    settings = for_preset("smoke")
    run = open_data_folder(tmp_path).run(settings.run_name)
    assert stages_of(run) == []
    collect(settings, str(tmp_path))
    collect(settings, str(tmp_path))
    records = stages_of(run)
    assert [record["stage"] for record in records] == ["collect", "collect"]
    assert all(record | machine() == record for record in records)
    assert stage_seconds(records) == {"collect": sum(record["seconds"] for record in records)}


def test_a_stage_that_fails_has_no_record(tmp_path: Path) -> None:
    settings = for_preset("smoke", strict=True)
    with pytest.raises(RuntimeError, match="a bad world"):
        collect(settings, str(tmp_path))
    assert stages_of(open_data_folder(tmp_path).run(settings.run_name)) == []


def test_a_timed_stage_still_tells_what_it_wants() -> None:
    assert list(inspect.signature(collect).parameters) == ["settings", "data"]
    assert get_type_hints(collect)["settings"] is RunSettings


def test_a_line_a_stage_and_one_for_all_of_them() -> None:
    load = {"what": "x", "chunks": 3, "workers": 2, "busy_seconds": 9.0, "span_seconds": 10.0}
    load |= {"first_bytes": 5_000_000, "last_bytes": 6_000_000}
    records = [
        {"stage": "collect", "seconds": 4.0, "fan_outs": [load, load]},
        {"stage": "report", "seconds": 1.0, "fan_outs": []},
        {"stage": "collect", "seconds": 2.0, "fan_outs": [load | {"busy_seconds": 10.0}]},
    ]
    assert stage_cells(records) == [
        ["collect", "6.0", "9", "2", "6.7", "5", "6"],
        ["report", "1.0", "–", "–", "–", "–", "–"],
        ["all", "7.0", "9", "2", "6.7", "5", "6"],
    ]
    assert stage_cells([]) == []
