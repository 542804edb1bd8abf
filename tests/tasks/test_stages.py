from __future__ import annotations

import inspect
from pathlib import Path
from typing import get_type_hints

import pytest

from storage.layout import open_data_folder
from tasks.settings import RunSettings, for_preset
from tasks.stages import machine, stage_seconds, stages_of, timed


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
