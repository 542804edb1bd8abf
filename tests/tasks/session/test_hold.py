"""A data folder is held by one process at a time, whoever has started the flow that needs it."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from storage.errors import InUseError
from storage.places.data_folder import open_data_folder
from tasks.session.hold import hold, holding
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings

SETTINGS = for_preset("smoke")
HOLD = "import sys; from tasks.session.hold import hold\nwith hold(sys.argv[1]): pass"


def _other_process(data: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", HOLD, str(data)], capture_output=True, text=True, cwd=Path(__file__).parents[3]
    )


@holding
def inner(settings: RunSettings, data: str, word: str = "inner") -> str:
    return word


@holding
def outer(settings: RunSettings, data: str) -> str:
    return inner(settings, data, word="from outer") + inner(settings, data)


def test_a_flow_in_a_flow_holds_what_is_held_already(tmp_path: Path) -> None:
    with hold(tmp_path):
        assert outer(SETTINGS, str(tmp_path)) == "from outerinner"
        assert "is in use by another command" in _other_process(tmp_path).stderr
    assert outer(SETTINGS, str(tmp_path)) == "from outerinner"
    assert _other_process(tmp_path).returncode == 0


def test_a_flow_that_nobody_holds_for_takes_the_folder_itself(tmp_path: Path) -> None:
    with open_data_folder(tmp_path).lock(), pytest.raises(InUseError, match="is in use by another command"):
        outer(SETTINGS, str(tmp_path))


def test_a_flow_is_known_by_its_own_name_and_parameters() -> None:
    assert list(inspect.signature(inner).parameters) == ["settings", "data", "word"]
    assert inner.__name__ == "inner"
