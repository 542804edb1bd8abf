"""Only one process at a time locks a data folder, whoever has started the flow that needs it."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from storage.errors import InUseError
from storage.places.data_folder import open_data_folder
from tasks.session.folder_lock import locked_folder, locks_data_folder
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings

SETTINGS = for_preset("smoke")
LOCK = (
    "import sys; from tasks.session.folder_lock import locked_folder\nwith locked_folder(sys.argv[1]): pass"
)


def _other_process(data: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", LOCK, str(data)], capture_output=True, text=True, cwd=Path(__file__).parents[3]
    )


@locks_data_folder
def inner(settings: RunSettings, data: str, word: str = "inner") -> str:
    return word


@locks_data_folder
def outer(settings: RunSettings, data: str) -> str:
    return inner(settings, data, word="from outer") + inner(settings, data)


def test_a_flow_in_a_flow_uses_the_lock_of_the_outer_one(tmp_path: Path) -> None:
    with locked_folder(tmp_path):
        assert outer(SETTINGS, str(tmp_path)) == "from outerinner"
        assert "is in use by another command" in _other_process(tmp_path).stderr
    assert outer(SETTINGS, str(tmp_path)) == "from outerinner"
    assert _other_process(tmp_path).returncode == 0


def test_a_flow_locks_its_folder_itself_if_nobody_has(tmp_path: Path) -> None:
    with open_data_folder(tmp_path).lock(), pytest.raises(InUseError, match="is in use by another command"):
        outer(SETTINGS, str(tmp_path))


def test_a_decorated_flow_keeps_its_name_and_parameters() -> None:
    assert list(inspect.signature(inner).parameters) == ["settings", "data", "word"]
    assert inner.__name__ == "inner"
