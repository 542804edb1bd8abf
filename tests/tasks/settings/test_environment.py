from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest

from tasks.settings.environment import environment, memory_named, run_named


def test_variables_are_as_before_at_the_end_even_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MOTION_MEMORY_KNOWN", "before")
    monkeypatch.delenv("MOTION_MEMORY_NEW", raising=False)
    with suppress(KeyError), environment(MOTION_MEMORY_KNOWN="x", MOTION_MEMORY_NEW="y"):
        assert (os.environ["MOTION_MEMORY_KNOWN"], os.environ["MOTION_MEMORY_NEW"]) == ("x", "y")
        raise KeyError
    assert os.environ["MOTION_MEMORY_KNOWN"] == "before"
    assert "MOTION_MEMORY_NEW" not in os.environ


def test_a_run_may_be_given_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MOTION_MEMORY_DATA", str(tmp_path / "data"))
    run = tmp_path / "data" / "runs" / "one"
    run.mkdir(parents=True)
    assert run_named("one") == run
    assert memory_named("one") == str(run)
    assert memory_named("models:/one/1") == "models:/one/1"
    for folder in ("another", "runs/one", str(run)):
        assert run_named(folder) == Path(folder)
    (tmp_path / "one").mkdir()
    assert run_named("one") == Path("one")  # what is there comes first
