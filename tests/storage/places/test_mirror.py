"""Object storage: written whole, read on any machine, fetched only when it changed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from botocore.exceptions import ClientError
from hypothesis import given
from hypothesis import strategies as st

from planners.world.vehicles.vehicle import CAR
from storage.archives.archive import read_archive, write_archive
from storage.errors import StorageError, UnreachableError
from storage.places import objects
from storage.places.data_folder import MARK, data_folder_at, open_data_folder, open_run
from storage.places.files import read_json, read_text, whole_file, write_json
from storage.places.mirror import (
    fetch,
    files_in,
    folders_here,
    is_there,
    local_place,
    looking_once,
    object_of,
    remove,
    shown,
)
from storage.tables.shards import read_table, shard_is_done, write_table
from tests.storage.object_storage import BUCKET, DATA, Failing, machine, object_storage

SCHEMA = pa.schema([("n", pa.int64())], metadata={"schema": "numbers/1"})
names = st.text("abcXYZ019-_.", min_size=1, max_size=8).filter(lambda name: name.strip("."))

pytestmark = pytest.mark.filterwarnings("ignore")  # of the server's libraries


@pytest.fixture
def storage() -> Iterator[Any]:
    with object_storage() as client:
        yield client


@pytest.fixture
def here(tmp_path: Path) -> Iterator[Path]:
    with machine(tmp_path / "here") as folder:
        yield folder


def _keys(storage: Any) -> set[str]:
    return {each["Key"] for each in storage.list_objects_v2(Bucket=BUCKET).get("Contents", ())}


@given(names, st.lists(names, max_size=4))
def test_a_place_in_storage_and_the_path_that_stands_for_it_name_each_other(
    bucket: str, parts: list[str]
) -> None:
    place = "/".join([f"s3://{bucket}", *parts])
    path = local_place(place)
    assert shown(path) == place
    assert local_place(Path(place)) == path  # pathlib makes one slash of two
    assert object_of(path) == (bucket, "/".join(parts))
    assert local_place(path) == path


@pytest.mark.parametrize("place", ["s3://bucket/../other", "s3://../x", "s3://bucket/./x"])
def test_a_place_that_reaches_out_of_its_bucket_is_refused(place: str) -> None:
    with pytest.raises(StorageError, match=r"^s3://"):
        local_place(place)


def test_paths_elsewhere_are_left_alone(tmp_path: Path, here: Path) -> None:
    write_json(tmp_path / "mine.json", 1)
    assert object_of(tmp_path / "mine.json") is None
    assert read_json(tmp_path / "mine.json") == 1
    assert shown(tmp_path) == str(tmp_path)


def test_what_one_machine_writes_another_reads(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "one"):
        run = open_data_folder(DATA).run("run")
        write_json(run.settings, {"seed": 1})
        write_table(run.shard("results", "trap", 0), pa.table({"n": [1, 2]}, SCHEMA), "key")
    with machine(tmp_path / "other"):
        folder = open_data_folder(DATA)
        assert folder.place == DATA
        (run,) = folder.runs()
        assert read_json(run.settings) == {"seed": 1}
        (shard,) = run.shards("results", "trap")
        assert read_table(shard, SCHEMA)["n"].to_pylist() == [1, 2]
        assert open_run(Path(f"{DATA}/runs/run")).path == run.path
    assert _keys(storage) == {
        f"team/data/{name}" for name in (MARK, "runs/run/settings.json", "runs/run/results/trap/0000.parquet")
    }


def test_a_file_is_fetched_when_it_changed_and_only_then(storage: Any, tmp_path: Path) -> None:
    asked = Failing(storage)
    with machine(tmp_path / "one"):
        path = open_data_folder(DATA).path / "x.json"
        write_json(path, "first")
        asked.operations.clear()
        assert read_json(path) == "first"
        assert "GetObject" not in asked.operations  # it is what was just written
    with machine(tmp_path / "other"):
        write_json(open_data_folder(DATA).path / "x.json", "other")
    with machine(tmp_path / "one"):
        assert [read_json(path) for _ in range(3)] == ["other"] * 3
        assert asked.operations.count("GetObject") == 2  # of which one is the mark, on the other machine
        remove(path)
        with pytest.raises(StorageError, match=r"x.json does not exist"):
            read_json(path)


def test_within_a_chunk_a_file_is_asked_for_once(storage: Any, here: Path) -> None:
    path = open_data_folder(DATA).path / "x.json"
    write_json(path, 1)
    asked = Failing(storage)
    with looking_once():
        for _ in range(5):
            assert read_json(path) == 1
    assert asked.operations == ["HeadObject"]


def test_an_archive_is_one_object_and_the_same_elsewhere(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "one"):
        folder = open_data_folder(DATA).run("run").memory("trap")
        for content in (b"old", b"newer"):
            write_archive(folder, "thing", CAR, {"a": 1}, {"x.bin": content})
        assert {key for key in _keys(storage) if "memories" in key} == {
            "team/data/runs/run/memories/trap.tar"
        }
        assert read_archive(folder, "thing", CAR)[1]["x.bin"][:] == b"newer"
    with machine(tmp_path / "other"):
        folder = open_data_folder(DATA).run("run").memory("trap")
        assert not folder.exists()
        assert is_there(folder)
        assert not folder.exists()
        header, files = read_archive(folder, "thing", CAR)
        assert (header["a"], files["x.bin"][:]) == (1, b"newer")
        when = folder.stat().st_ino
        read_archive(folder, "thing", CAR)
        assert folder.stat().st_ino == when
    with machine(tmp_path / "one"):
        write_archive(
            open_data_folder(DATA).run("run").memory("trap"), "thing", CAR, {"a": 2}, {"x.bin": b"third"}
        )
    with machine(tmp_path / "other"):
        assert read_archive(folder, "thing", CAR)[0]["a"] == 2
        leftovers = [path.name for path in folder.parent.iterdir() if path.name.endswith(".partial")]
        assert leftovers == []


def test_a_damaged_archive_is_refused(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "one"):
        folder = open_data_folder(DATA).run("run").memory("trap")
        write_archive(folder, "thing", CAR, {}, {"x.bin": b"content of it"})
    key = "team/data/runs/run/memories/trap.tar"
    body = storage.get_object(Bucket=BUCKET, Key=key)["Body"].read()
    storage.put_object(Bucket=BUCKET, Key=key, Body=body.replace(b"content", b"CONTENT"))
    with machine(tmp_path / "other"), pytest.raises(StorageError, match=r"x.bin is damaged"):
        read_archive(open_data_folder(DATA).run("run").memory("trap"), "thing", CAR)


def test_whether_a_shard_is_done_is_known_without_fetching_it(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "one"):
        shard = open_data_folder(DATA).run("run").shard("results", "trap", 0)
        write_table(shard, pa.table({"n": [1]}, SCHEMA), "key")
    with machine(tmp_path / "other"):
        shard = open_data_folder(DATA).run("run").shard("results", "trap", 0)
        assert shard_is_done(shard, "key")
        assert not shard_is_done(shard, "another")
        assert not shard_is_done(shard.with_name("0001.parquet"), "key")
        assert not shard.exists()


def test_listing_fetches_nothing_and_keeps_to_its_folder(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "one"):
        root = open_data_folder(DATA).path
        for name in ("a/1.png", "a/2.svg", "a/b/3.png", "ab/4.png", "a/.5.png"):
            write_json(root / name, 0)
    with machine(tmp_path / "other"):
        root = open_data_folder(DATA).path
        assert [path.name for path in files_in(root / "a", "[!.]*.png")] == ["1.png"]
        assert [path.name for path in files_in(root / "a", "[!.]*.png", below=True)] == ["1.png", "3.png"]
        assert not (root / "a").exists()


def test_what_cannot_be_put_leaves_what_was_there(
    storage: Any, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = open_data_folder(DATA).path / "x.json"
    write_json(path, "old")

    def refuse(*_: object, **__: object) -> None:
        told = {"Error": {"Code": "AccessDenied"}, "ResponseMetadata": {"HTTPStatusCode": 403}}
        raise ClientError(told, "PutObject")

    with monkeypatch.context() as denied:
        denied.setattr(storage, "put_object", refuse)
        with pytest.raises(StorageError, match=r"data/x.json cannot be written: .*AccessDenied") as refused:
            write_json(path, "new")
    assert "\n" not in str(refused.value)
    assert not isinstance(refused.value, UnreachableError)
    assert read_json(path) == "old"
    with pytest.raises(RuntimeError), whole_file(path):
        raise RuntimeError
    assert read_text(path) == '"old"\n'


def test_errors_that_pass_are_not_seen(storage: Any, here: Path) -> None:
    path = open_data_folder(DATA).path / "x.json"
    failing = Failing(storage)
    failing.left = 2
    write_json(path, [1, 2])
    failing.left = 2
    assert fetch(path).exists()
    assert read_json(path) == [1, 2]


def test_errors_that_stay_are_told_in_one_line(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "ATTEMPTS", 2)
    with object_storage() as storage:
        path = open_data_folder(DATA).path / "x.json"
        failing = Failing(storage)
        for act in (lambda: write_json(path, 1), lambda: fetch(path), lambda: files_in(path.parent, "*")):
            failing.left = 1000
            with pytest.raises(UnreachableError, match=r"^s3://") as told:
                act()
            assert "\n" not in str(told.value)
            failing.left = 0


def test_a_folder_of_somebody_else_and_one_of_another_version_are_refused(storage: Any, here: Path) -> None:
    storage.put_object(Bucket=BUCKET, Key="team/data/thesis.txt", Body=b"mine")
    with pytest.raises(StorageError, match=r"s3://bucket/team/data is not empty"):
        open_data_folder(DATA)
    storage.put_object(Bucket=BUCKET, Key=f"team/data/{MARK}", Body=json.dumps({"layout": 99}).encode())
    with pytest.raises(StorageError, match=r"s3://bucket/team/data has data layout 99"):
        open_data_folder(DATA)
    with pytest.raises(StorageError, match=r"cannot be (read|listed).*Check bucket"):
        open_data_folder("s3://nowhere/data")


def test_a_memory_is_fetched_by_its_own_name_or_by_its_runs(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "there"):
        run = open_data_folder(DATA).run("first")
        for name in ("curves", "trap"):
            write_archive(run.memory(name), "memory", CAR, {}, {"a.bin": name.encode()})
    with machine(tmp_path / "here"):
        folder = folders_here(f"{DATA}/runs/first", "memories")
        for name in ("curves", "trap"):
            assert (folder / "memories" / name / "a.bin").read_bytes() == name.encode()
    with machine(tmp_path / "elsewhere"):
        folder = folders_here(f"{DATA}/runs/first/memories/trap", "memories")
        assert (folder / "a.bin").read_bytes() == b"trap"
        assert not (folder.parent / "curves").exists()
        with pytest.raises(StorageError, match="s3://bucket/team/data/runs/second holds nothing"):
            folders_here(f"{DATA}/runs/second", "memories")
    assert folders_here(str(tmp_path), "memories") == tmp_path


def test_looking_for_a_data_folder_writes_nothing_and_names_what_else_is_there(
    storage: Any, here: Path
) -> None:
    assert data_folder_at(DATA) is None
    assert storage.list_objects_v2(Bucket=BUCKET)["KeyCount"] == 0
    write_json(local_place(DATA) / "notes.json", {})
    with pytest.raises(StorageError, match=f"{DATA} is not empty"):
        data_folder_at(DATA)
    remove(local_place(DATA) / "notes.json")
    assert open_data_folder(DATA) == data_folder_at(DATA)
