"""A settings.json that somebody has edited is refused in one line, or changes nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.files import read_json, write_json
from storage.places.run_folder import RunFolder
from storage.tables.attempts import write_attempts
from tasks.fan_out.chunk import keep_settings, run_folder
from tasks.inputs.champion_run import champion_run
from tasks.reports.compare import compare
from tasks.requests.verify_folder import verify_folder
from tasks.settings.presets import for_preset
from tasks.settings.recorded_settings import recorded_settings
from tests.storage.tables.test_tables import ATTEMPT

SETTINGS = for_preset("smoke", classes=["trap"])


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    """The folder of a run with a row."""
    data = str(open_data_folder(tmp_path / "data").path)
    keep_settings(data, SETTINGS)
    run = run_folder(data, SETTINGS)
    write_attempts(run.shard("results", "trap", 0), [{**ATTEMPT, "run_id": SETTINGS.run_name}])
    return run


def edited(run: RunFolder, **changes: Any) -> RunFolder:
    write_json(run.settings, {**read_json(run.settings), **changes})
    return run


@pytest.mark.parametrize("change", [{"seed": 2}, {"experiences": 7}, {"classes": ["curves"]}])
def test_edited_settings_are_refused_in_one_line_until_the_same_command_writes_them_anew(
    run: RunFolder, change: dict[str, Any]
) -> None:
    data = run.path.parents[1]
    assert recorded_settings(edited(run)) == SETTINGS
    edited(run, **change)
    for use in (lambda: verify_folder(data, 0.0, 1), lambda: compare([run.path, run.path], None)):
        with pytest.raises(StorageError, match=f"edited.*{run.path.name} to write them again") as refusal:
            use()
        assert "\n" not in str(refusal.value)
    assert champion_run(str(data), run.path.name) is None
    keep_settings(str(data), SETTINGS)
    assert recorded_settings(run) == SETTINGS


@pytest.mark.parametrize("text", ["", "[]", "{", '{"preset": "smoke"}', json.dumps({"seed": None})])
def test_what_are_no_settings_is_refused_in_one_line(run: RunFolder, text: str) -> None:
    run.settings.write_text(text)
    with pytest.raises(StorageError) as refusal:
        recorded_settings(run)
    assert "\n" not in str(refusal.value)


def test_a_run_whose_folder_was_renamed_is_known_by_its_rows(run: RunFolder, tmp_path: Path) -> None:
    renamed = RunFolder(run.path.rename(tmp_path / "mine"))
    assert recorded_settings(renamed) == SETTINGS
    with pytest.raises(StorageError, match="edited"):
        recorded_settings(edited(renamed, seed=2))
