"""Slices of files of problems: together they are the file, each found without reading what is before."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.exchange.problem_files import SLICES_A_GROUP, Unreadable, raw_problems, raw_slice, slices_of
from tests.storage.samples import quick


def _objects(count: int) -> list[dict[str, Any]]:
    return [
        {"id": f"p-{i}", "start": [float(i), 0.0, 0.0], "obstacles": [[[0.0, i]] * 3]} for i in range(count)
    ]


def _with_blanks(objects: list[dict[str, Any]], blanks: set[int]) -> str:
    return "".join(
        ("\n \n" if i in blanks else "") + json.dumps(each) + "\n" for i, each in enumerate(objects)
    )


@quick
@given(
    count=st.integers(1, 30), size=st.integers(1, 12), blanks=st.sets(st.integers(0, 30)), last=st.booleans()
)
def test_slices_of_a_text_are_the_text(
    tmp_path_factory: pytest.TempPathFactory, count: int, size: int, blanks: set[int], last: bool
) -> None:
    path = tmp_path_factory.getbasetemp() / "slices.jsonl"
    text = _with_blanks(_objects(count), blanks)
    path.write_text(text if last else text.rstrip("\n"))
    slices = slices_of(path, size)
    assert [raw for piece in slices for raw in raw_slice(piece)] == list(raw_problems(path))
    assert [piece.count for piece in slices] == [min(size, count - i) for i in range(0, count, size)]


@quick
@given(count=st.integers(0, 60), size=st.integers(1, 12), group=st.integers(1, 60))
def test_slices_of_a_table_are_the_table(
    tmp_path_factory: pytest.TempPathFactory, count: int, size: int, group: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "slices.parquet"
    schema = pa.Table.from_pylist(_objects(1)).schema
    pq.write_table(pa.Table.from_pylist(_objects(count), schema), path, row_group_size=group)
    slices = slices_of(path, size)
    assert [raw for piece in slices for raw in raw_slice(piece)] == list(raw_problems(path))
    longest = max(size, -(-min(group, count) // SLICES_A_GROUP))
    assert all(piece.count <= longest for piece in slices)


def test_a_corrected_line_leaves_the_other_slices_as_they_were(tmp_path: Path) -> None:
    objects = _objects(20)
    path = tmp_path / "p.jsonl"
    path.write_text(_with_blanks(objects, set()))
    before = slices_of(path, 5)
    objects[7]["start"] = [1.0, 2.0, 3.0]
    path.write_text(_with_blanks(objects, set()))
    after = slices_of(path, 5)
    assert [a.digest == b.digest for a, b in zip(before, after, strict=True)] == [True, False, True, True]


def test_of_a_broken_line_the_reason_is_told_and_the_others_are_read(tmp_path: Path) -> None:
    path = tmp_path / "p.jsonl"
    path.write_bytes(_with_blanks(_objects(7), {2}).encode() + b'{"id": \xff}\n{"id": \n')
    *whole, (line, first), (last, second) = raw_problems(path)
    assert [each for piece in slices_of(path, 4) for each in raw_slice(piece)] == list(raw_problems(path))
    assert len(whole) == 7
    assert (line, last) == (10, 11)
    assert isinstance(first, Unreadable)
    assert "UTF-8" in first.reason
    assert isinstance(second, Unreadable)
    assert "JSON" in second.reason
