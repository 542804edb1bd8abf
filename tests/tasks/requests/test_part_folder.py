"""The folder of finished parts: one command holds it, to its very end, and then it is gone."""

from __future__ import annotations

import fcntl
from contextlib import suppress
from pathlib import Path

import pytest

from storage.errors import InUseError
from tasks.requests.part_folder import parts_folder, remove_parts, unfinished


def _refused(out: Path) -> bool:
    try:
        with unfinished(out):
            return False
    except InUseError:
        return True


def test_a_command_holds_the_folder_until_it_ends(tmp_path: Path) -> None:
    out = tmp_path / "rows.parquet"
    with unfinished(out):
        assert _refused(out)
        (parts_folder(out) / "000000.parquet").touch()
        (parts_folder(out) / "prefect").mkdir()
        remove_parts(out)
        assert [each.name for each in parts_folder(out).iterdir()] == [".lock"]
        assert _refused(out)
    assert list(tmp_path.iterdir()) == []


def test_parts_of_a_command_that_failed_are_kept(tmp_path: Path) -> None:
    out = tmp_path / "rows.parquet"
    with suppress(ZeroDivisionError), unfinished(out):
        (parts_folder(out) / "000000.parquet").touch()
        raise ZeroDivisionError
    with unfinished(out):
        assert (parts_folder(out) / "000000.parquet").exists()


def test_a_command_that_begins_while_another_ends_holds_the_folder_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "rows.parquet"
    ends = unfinished(out)
    ends.__enter__()
    flock = fcntl.flock

    def late(handle: int, operation: int) -> None:
        monkeypatch.undo()
        ends.__exit__(None, None, None)
        flock(handle, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    with unfinished(out):
        assert _refused(out)
    assert list(tmp_path.iterdir()) == []
