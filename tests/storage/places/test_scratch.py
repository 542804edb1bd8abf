"""Scratch folders: one for each need, private, and gone even if the process was killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from storage.places.scratch import PREFIX, scratch_folder

ROOT = Path(__file__).parents[3]
HOLD = """
import sys
from storage.places.scratch import scratch_folder
with scratch_folder() as folder:
    (folder / "deep").mkdir()
    (folder / "deep" / "file").touch()
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))


def _holder() -> tuple[subprocess.Popen[str], Path]:
    held = subprocess.Popen(
        [sys.executable, "-c", HOLD], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert held.stdout
    return held, Path(held.stdout.readline().strip())


def test_a_scratch_folder_is_its_owners_alone_and_goes_with_its_need(tmp_path: Path) -> None:
    with scratch_folder() as folder:
        assert folder.parent == tmp_path
        assert folder.stat().st_mode & 0o777 == 0o700
    assert not folder.exists()


def test_what_killed_processes_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    (killed, left), (living, kept) = _holder(), _holder()
    others = [tmp_path / "motion-memory-other", tmp_path / "elsewhere"]
    for other in others:
        other.mkdir()
    link = tmp_path / f"{PREFIX}link"
    link.symlink_to(others[1])
    try:
        killed.send_signal(signal.SIGKILL)
        killed.communicate()
        with scratch_folder():
            assert not left.exists()
            assert (kept / "deep" / "file").exists()
            assert all(other.exists() for other in (*others, link))
    finally:
        living.communicate()
    assert not kept.exists()


def test_what_other_users_left_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / f"{PREFIX}left").mkdir()
    own = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: own + 1)
    with scratch_folder():
        pass
    assert (tmp_path / f"{PREFIX}left").exists()
