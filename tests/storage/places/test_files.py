"""Files and folders are whole whenever a writer is killed, and a lock has one holder."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from storage.errors import InUseError
from storage.places.files import locked, remove_leftovers, whole_file, whole_folder
from storage.places.swap import swap

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("can_swap", [False, True])
@pytest.mark.parametrize("moves", [0, 1, 2])
def test_a_folder_is_whole_whenever_its_writer_is_killed(
    tmp_path: Path, moves: int, can_swap: bool, there: bool
) -> None:
    folder = tmp_path / "champ"
    if there:
        folder.mkdir()
        (folder / "plans").write_text("old")
    command = [sys.executable, "-m", "tests.storage.places.killed_writer"]
    killed = subprocess.run([*command, str(folder), str(moves), str(can_swap)], cwd=ROOT)
    assert killed.returncode in (0, -signal.SIGKILL)
    assert killed.returncode == -signal.SIGKILL or moves > 0
    if can_swap:
        assert folder.exists() == (there or moves > 0)
    remove_leftovers(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["champ"] * (there or moves > 0)
    if folder.exists():
        assert (folder / "plans").read_text() == ("old" if there and moves < 2 - can_swap else "new")


def test_paths_change_places_or_stay(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    for each in (first, second):
        each.mkdir()
        (each / each.name).touch()
    changed = swap(first, second)
    assert (second / "first").exists() == (first / "second").exists() == changed
    assert (second / "second").exists() == (first / "first").exists() != changed
    assert not swap(first, tmp_path / "missing")
    assert first.exists()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell the umask")
@pytest.mark.parametrize("umask", [0o022, 0o027, 0o077])
def test_permissions_follow_the_umask_which_is_never_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, umask: int
) -> None:
    before = os.umask(umask)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", None)
            with whole_file(tmp_path / "file") as temporary:
                temporary.touch()
            with whole_folder(tmp_path / "folder"):
                pass
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o666 & ~umask
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o777 & ~umask


@pytest.mark.parametrize("lost", ["lock", "folder"])
def test_a_lock_has_one_holder_even_if_another_removed_it_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lost: str
) -> None:
    path = tmp_path / "folder" / ".lock"
    flock = fcntl.flock

    def late(handle: int, operation: int) -> None:
        monkeypatch.undo()
        path.unlink() if lost == "lock" else shutil.rmtree(path.parent)
        flock(handle, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    with (
        locked(path, "it"),
        pytest.raises(InUseError, match="it is in use by another command"),
        locked(path, "it"),
    ):
        pass
    with locked(path, "it"):
        pass
