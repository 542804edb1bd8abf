from __future__ import annotations

import json
import multiprocessing
import os
from pathlib import Path

import pytest

from storage.errors import StorageError
from storage.places.data_folder import MARK, open_data_folder
from storage.places.run_folder import checked_name


def one_line(error: pytest.ExceptionInfo[StorageError]) -> str:
    text = str(error.value)
    assert "\n" not in text
    return text


def test_a_new_folder_is_marked_and_opens_again(tmp_path: Path) -> None:
    folder = open_data_folder(tmp_path / "new" / "data")
    assert json.loads((folder.path / MARK).read_text()) == {"layout": 1}
    assert open_data_folder(folder.path) == folder


def test_a_new_folder_is_its_owners_alone_and_an_old_one_as_its_owner_made_it(tmp_path: Path) -> None:
    assert open_data_folder(tmp_path / "new" / "data").path.stat().st_mode & 0o777 == 0o700
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared").chmod(0o750)
    assert open_data_folder(tmp_path / "shared").path.stat().st_mode & 0o777 == 0o750


def test_a_relative_folder_becomes_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert open_data_folder("data").path == tmp_path / "data"


def test_a_folder_of_somebody_else_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(StorageError) as error:
        open_data_folder(tmp_path)
    assert str(tmp_path) in one_line(error)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("mark", ['{"layout": 2}', '{"layout": "1"}', "[]", '{"lay', "", "null"])
def test_a_folder_of_another_version_or_a_damaged_mark_is_refused(tmp_path: Path, mark: str) -> None:
    (tmp_path / MARK).write_text(mark)
    with pytest.raises(StorageError) as error:
        open_data_folder(tmp_path)
    assert str(tmp_path) in one_line(error)


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("")
    for path in (tmp_path / "data", tmp_path / "data" / "below"):
        with pytest.raises(StorageError) as error:
            open_data_folder(path)
        assert "cannot be used as a data folder" in one_line(error)


def test_an_unwritable_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    open_data_folder(tmp_path)
    monkeypatch.setattr(os, "access", lambda *_: False)  # the tests' user may be root, who may do anything
    with pytest.raises(StorageError) as error:
        open_data_folder(tmp_path)
    assert "Permission denied" in one_line(error)


def test_a_folder_whose_making_was_killed_opens(tmp_path: Path) -> None:
    (tmp_path / f".{MARK}.x1y2.partial").write_text('{"lay')
    assert open_data_folder(tmp_path).path == tmp_path


def test_a_second_command_is_told_who_holds_the_folder(tmp_path: Path) -> None:
    folder = open_data_folder(tmp_path)
    with folder.lock():
        with pytest.raises(StorageError) as error, folder.lock():
            pass
        assert f"process {os.getpid()}" in one_line(error)
    with folder.lock():
        pass


def _die_holding(path: Path) -> None:
    with open_data_folder(path).lock():
        os._exit(1)


def test_a_killed_command_leaves_the_folder_free_and_its_leftovers_go(tmp_path: Path) -> None:
    folder = open_data_folder(tmp_path)
    process = multiprocessing.get_context("spawn").Process(target=_die_holding, args=(tmp_path,))
    process.start()
    process.join()
    shard = folder.run("one").shard("results", "trap", 0)
    shard.parent.mkdir(parents=True)
    leftover = shard.with_name(f".{shard.name}.abc.partial")
    leftover.write_text("half")
    half_folder = shard.with_name(".memory.abc.partial")
    half_folder.mkdir()
    shard.write_text("whole")
    with folder.lock():
        assert list(shard.parent.iterdir()) == [shard]


def test_shards_come_in_order_without_what_is_half_written(tmp_path: Path) -> None:
    run = open_data_folder(tmp_path).run("one")
    for index in (10, 2, 0, 12345):
        shard = run.shard("hallucinated", "trap", index)
        shard.parent.mkdir(parents=True, exist_ok=True)
        shard.touch()
        shard.with_name(f".{shard.name}.abc.partial").touch()
    names = [path.name for path in run.shards("hallucinated", "trap")]
    assert names == ["0000.parquet", "0002.parquet", "0010.parquet", "12345.parquet"]
    assert run.shards("results", "trap") == []


def test_all_places_of_a_run_differ_and_lie_inside_it(tmp_path: Path) -> None:
    folder = open_data_folder(tmp_path)
    run = folder.run("one")
    places = [
        run.settings,
        run.results,
        run.recalls,
        run.figures,
        run.summary("json"),
        run.worlds("trap", "test"),
        run.experiences("trap"),
        run.model("trap"),
        run.memory("trap"),
        *(run.shard(table, "trap", 0) for table in ("experiences", "hallucinated", "results", "recalls")),
    ]
    assert len(set(places)) == len(places)
    assert all(place.is_relative_to(run.path) for place in places)
    assert run.path == tmp_path / "runs" / "one"


def test_runs_are_listed_by_name(tmp_path: Path) -> None:
    folder = open_data_folder(tmp_path)
    assert folder.runs() == []
    for name in ("b", "a"):
        folder.run(name).path.mkdir(parents=True)
    assert folder.runs() == [folder.run("a"), folder.run("b")]


@pytest.mark.parametrize("name", ["", "..", "a/b", "-a", ".a", "a b", "ä", "a\n", "a" * 101, "a\0"])
def test_a_name_that_is_no_plain_word_is_refused(name: str) -> None:
    with pytest.raises(StorageError) as error:
        checked_name(name)
    assert "letters, digits" in one_line(error)
