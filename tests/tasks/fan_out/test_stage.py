"""Chunks: they cover everything once, and their keys change with whatever their rows depend on."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prefect.client.schemas.objects import State, StateType

from storage.errors import StorageError, UnreachableError
from storage.places.files import read_json, write_json
from tasks.fan_out import keys
from tasks.fan_out.keys import key_of
from tasks.fan_out.stage import _may_pass, chunk_task, chunks_of, is_marked, kept_result, mark_done
from tasks.settings.run_settings import for_preset

SETTINGS = for_preset("smoke")


@given(st.integers(0, 500), st.integers(1, 60))
def test_chunks_cover_every_problem_once_and_in_order(count: int, size: int) -> None:
    chunks = chunks_of("data", SETTINGS, "stage", "trap", count, size, [])
    assert [i for chunk in chunks for i in range(chunk.first, chunk.last)] == list(range(count))
    assert [chunk.index for chunk in chunks] == list(range(len(chunks)))
    assert len({chunk.key for chunk in chunks}) == len(chunks)


@given(st.integers(1, 500), st.integers(1, 60), st.integers(0, 500))
def test_asking_for_more_keeps_the_full_chunks(count: int, size: int, more: int) -> None:
    few = chunks_of("data", SETTINGS, "stage", "trap", count, size, [])
    many = chunks_of("data", SETTINGS, "stage", "trap", count + more, size, [])
    full = count // size
    assert few[:full] == many[:full]


@pytest.mark.parametrize(
    "other", [("other", "trap", [1]), ("stage", "curves", [1]), ("stage", "trap", [2]), ("stage", "trap", [])]
)
def test_a_key_depends_on_stage_class_and_inputs(other: tuple[str, str, list[int]]) -> None:
    stage, name, inputs = other
    (one,) = chunks_of("data", SETTINGS, "stage", "trap", 1, 1, [1])
    (changed,) = chunks_of("data", SETTINGS, stage, name, 1, 1, inputs)
    assert one.key != changed.key


def test_an_edited_source_file_changes_every_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "edited"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "module.py").write_text("ANSWER = 42\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(keys, "PACKAGES", ("edited",))
    keys.sources_digest.cache_clear()
    before = key_of("same")
    (package / "module.py").write_text("ANSWER = 43\n")
    keys.sources_digest.cache_clear()
    after = key_of("same")
    keys.sources_digest.cache_clear()
    assert before != after


def test_a_folder_is_done_only_with_its_own_key(tmp_path: Path) -> None:
    place = tmp_path / "trap"
    assert not is_marked(place, "key")
    mark_done(place, "key")
    assert not is_marked(place, "key")  # the folder itself is not there
    place.mkdir()
    assert is_marked(place, "key")
    assert not is_marked(place, "another")


def test_what_a_chunk_told_is_kept_under_its_key(tmp_path: Path) -> None:
    one, other = chunks_of(str(tmp_path / "data"), SETTINGS, "stage", "trap", 2, 1, [])
    told = chunk_task(lambda chunk: {"solved": chunk.first}).fn(one)
    assert told["solved"] == 0
    assert kept_result(one) == told
    assert kept_result(other) is None
    write_json(one.result.with_name(other.result.name), {"solved": 5})
    assert kept_result(other) == {"solved": 5}
    assert read_json(one.result) == told


def _caused_by(error: OSError) -> StorageError:
    told = StorageError("it cannot be written")
    told.__cause__ = error
    return told


@pytest.mark.parametrize(
    ("error", "again"),
    [
        (UnreachableError("503"), True),
        (OSError(5, "Input/output error"), True),
        (_caused_by(OSError(116, "Stale file handle")), True),
        (StorageError("it is damaged"), False),
        (ValueError("this is no chunk"), False),
    ],
)
def test_only_what_may_pass_is_tried_again(error: Exception, again: bool) -> None:
    assert _may_pass(None, None, State(type=StateType.FAILED, data=error)) == again
