"""Chunks: they cover everything once, and their keys change with whatever their rows depend on."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prefect.client.schemas.objects import State, StateType
from prefect.utilities.callables import get_call_parameters

from storage.errors import StorageError, UnreachableError
from tasks import stages
from tasks.fan_out import keys
from tasks.fan_out.chunk import Chunk, Cut, chunks_of
from tasks.fan_out.keys import key_of
from tasks.fan_out.piece_task import _may_pass, piece_task
from tasks.fan_out.stage import Job, Stage, is_marked, mark_done
from tasks.libraries.judge_library import JUDGE_LIBRARY
from tasks.requests.adapt_pieces import ADAPT
from tasks.requests.gather_pieces import GATHER
from tasks.requests.problem_parts import SOLVE
from tasks.settings.presets import for_preset

SETTINGS = for_preset("smoke")
STAGES = [
    value
    for module in pkgutil.iter_modules(stages.__path__, "tasks.stages.")
    for value in vars(import_module(module.name)).values()
    if isinstance(value, Stage) and value.do.__module__ == module.name
]


@given(st.integers(0, 500), st.integers(1, 60))
def test_chunks_cover_every_problem_once_and_in_order(count: int, size: int) -> None:
    chunks = chunks_of("stage", "data", SETTINGS, "trap", Cut(count, size, []))
    assert [i for chunk in chunks for i in range(chunk.first, chunk.last)] == list(range(count))
    assert [chunk.index for chunk in chunks] == list(range(len(chunks)))
    assert len({chunk.key for chunk in chunks}) == len(chunks)


@given(st.integers(1, 500), st.integers(1, 60), st.integers(0, 500))
def test_asking_for_more_keeps_the_full_chunks(count: int, size: int, more: int) -> None:
    few = chunks_of("stage", "data", SETTINGS, "trap", Cut(count, size, []))
    many = chunks_of("stage", "data", SETTINGS, "trap", Cut(count + more, size, []))
    full = count // size
    assert few[:full] == many[:full]


@pytest.mark.parametrize(
    "other", [("other", "trap", [1]), ("stage", "curves", [1]), ("stage", "trap", [2]), ("stage", "trap", [])]
)
def test_a_key_depends_on_stage_class_and_inputs(other: tuple[str, str, list[int]]) -> None:
    stage, name, inputs = other
    (one,) = chunks_of("stage", "data", SETTINGS, "trap", Cut(1, 1, [1]))
    (changed,) = chunks_of(stage, "data", SETTINGS, name, Cut(1, 1, inputs))
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


class Solved(NamedTuple):
    solved: int


def solve_chunk(chunk: Chunk) -> Solved:
    chunk.shard("results").parent.mkdir(parents=True, exist_ok=True)
    chunk.shard("results").touch()
    return Solved(chunk.first)


STAGE = Stage(
    name="stage",
    do=solve_chunk,
    result=Solved,
    cut=lambda *_: Cut(2, 1, []),
    output=lambda chunk: chunk.shard("results"),
    is_whole=lambda path, _: path.exists(),
)


def test_the_result_of_a_chunk_is_kept_under_its_key_and_counts_only_with_its_output(tmp_path: Path) -> None:
    one, other, *_ = STAGE.chunks(str(tmp_path / "data"), SETTINGS)
    assert STAGE.kept(one) is None
    told = piece_task(STAGE).fn(one)
    assert told.result == Solved(0)
    assert STAGE.kept(one) == (told.result, None)
    assert STAGE.kept(other) is None
    assert one.result.parent == other.result.parent != one.run.path
    one.shard("results").unlink()
    assert STAGE.kept(one) is None


class Numbered(NamedTuple):
    class_name: str = "lot"
    index: int = 3


@pytest.mark.parametrize("job", [*STAGES, ADAPT, GATHER, JUDGE_LIBRARY, SOLVE], ids=lambda job: job.name)
def test_prefect_can_name_the_run_of_each_piece(job: Job[Any, Any]) -> None:
    """Whatever the function that does it calls its argument."""
    done_by = piece_task(job)
    asked = get_call_parameters(done_by.fn, (Numbered(),), {})
    assert isinstance(done_by.task_run_name, str)
    assert done_by.task_run_name.format(**asked).endswith(" lot 3")


def test_a_damaged_result_has_its_chunk_done_again(tmp_path: Path) -> None:
    (chunk, *_) = STAGE.chunks(str(tmp_path / "data"), SETTINGS)
    STAGE.run(chunk)
    chunk.result.write_text("{")
    assert STAGE.kept(chunk) is None


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_a_kept_result_is_read_as_what_the_stage_returns(stage: Stage[Any]) -> None:
    assert get_type_hints(stage.do)["return"] is stage.result


def test_no_two_stages_have_the_same_name() -> None:
    assert len({stage.name for stage in STAGES}) == len(STAGES)


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
