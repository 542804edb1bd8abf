"""Options are checked before anything is done; what is read is never written over."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from flows.cli.main import call
from storage.exchange.problems import write_problems
from tasks.settings.checks import check_outputs
from tasks.settings.errors import UsageError
from tests.storage.samples import box, problem_with
from tests.storage.worlds.samples import town_cells, write_map, write_ros

PROBLEM = problem_with([box(20, 20)])


def same_name(path: Path) -> Path:
    return path


def symbolic_link(path: Path) -> Path:
    link = path.with_name(f"link-{path.name}")
    link.symlink_to(path)
    return link


def hard_link(path: Path) -> Path:
    link = path.with_name(f"hard-{path.name}")
    os.link(path, link)
    return link


def roundabout(path: Path) -> Path:
    (path.parent / "folder").mkdir()
    return path.parent / "folder" / ".." / path.name


@pytest.mark.parametrize("other", [same_name, symbolic_link, hard_link, roundabout])
def test_a_file_by_any_name_is_not_written_over_itself(tmp_path: Path, other: Callable[[Path], Path]) -> None:
    path = tmp_path / "p.json"
    path.write_text("{}")
    for read, written in ((path, other(path)), (tmp_path / "nothing", tmp_path / "nothing")):
        with pytest.raises(UsageError, match="is read"):
            check_outputs([tmp_path / "q.json", read], [None, tmp_path / "new", written])


def test_nothing_is_written_into_a_folder_that_is_read(tmp_path: Path) -> None:
    (tmp_path / "memory").mkdir()
    check_outputs([tmp_path / "memory"], [tmp_path / "plan.json", tmp_path / "memory.json", None])
    with pytest.raises(UsageError, match="is read"):
        check_outputs([tmp_path / "memory"], [tmp_path / "memory" / "plan.json"])


@pytest.mark.parametrize(
    "arguments",
    [
        ["plan", "p.json", "--out", "p.json"],
        ["plan", "p.json", "--out", "./p.json"],
        ["plan", "p.json", "--out", "link.json"],
        ["plan", "p.json", "--vehicle", "car", "--memory", "memory", "--out", "memory/memory.json"],
        ["optimise", "p.json", "--out", "p.json"],
        ["optimise", "p.json", "--plan", "plan.json", "--out", "plan.json"],
        ["solve", "p.parquet", "--out", "p.parquet"],
        ["solve", "p.json", "--out", "rows.parquet", "--plans", "."],
        ["import-worlds", "p.parquet", "--out", "p.parquet"],
        ["import-worlds", "worlds", "--out", "worlds/p.parquet"],
        ["import-worlds", "town.yaml", "--out", "new.parquet", "--picture", "town.png"],
        ["route", "town.yaml", "--from", "8,6,0", "--to", "20,20", "--picture", "town.png"],
        ["route", "town.map", "--from", "8,6,0", "--to", "20,20", "--out", "town.map"],
    ],
)
def test_no_command_writes_over_what_it_reads(
    arguments: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("p.json", "p.parquet"):
        write_problems(Path(name), [PROBLEM])
    Path("link.json").symlink_to("p.json")
    Path("plan.json").write_text("{}")
    for folder, name in (("worlds", "p.parquet"), ("memory", "memory.json")):
        Path(folder).mkdir()
        Path(folder, name).write_text("{}")
    write_map(Path("town.map"), town_cells(rows=40, columns=40))
    write_ros(Path("town.yaml"), town_cells(rows=40, columns=40), "town.png")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    assert call(arguments) == 2
    printed = capsys.readouterr()
    assert str(Path(arguments[-1])) in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before
