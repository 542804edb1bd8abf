"""Whatever a field of a problem holds, and however its text is written: a problem, or one line."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.problem import Problem
from storage.errors import StorageError
from storage.exchange.problem_files import FIELDS
from storage.exchange.problems import fields_of, problem_of, read_problems
from tests.storage.samples import box, problem_with, quick

GOOD: dict[str, Any] = {
    **fields_of(problem_with([box(20, 20)], [box(30, 30)])),
    "scale": 1.0,
    "groups": [1, 1],
}
NUMBERS = st.one_of(
    st.floats(),
    st.integers(),
    st.sampled_from([0, -0.0, 5e-324, 1e-320, 1e-160, 1e154, 1e155, 1e308, 10**400, -(10**400), 2**63, True]),
)
VALUES = st.recursive(
    NUMBERS | st.none() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=10,
)


def is_problem_or_one_line(fields: Any) -> None:
    try:
        problem = problem_of(fields, "p")
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017
        assert len(str(error)) < 500  # noqa: PT017
    else:
        assert isinstance(problem, Problem)
        assert np.isfinite(problem.obstacles.vertices).all()


@quick
@given(name=st.sampled_from(FIELDS), value=VALUES)
def test_a_field_of_any_value(name: str, value: Any) -> None:
    is_problem_or_one_line({**GOOD, name: value})


@quick
@given(data=st.data(), number=NUMBERS)
def test_one_number_of_any_value(data: st.DataObject, number: Any) -> None:
    fields = copy.deepcopy(GOOD)
    where: Any = fields
    key: Any = data.draw(
        st.sampled_from(["start", "goal", "goal_radius", "bounds", "obstacles", "scale", "groups"])
    )
    while isinstance(where[key], list):
        where = where[key]
        key = data.draw(st.integers(0, len(where) - 1))
    where[key] = number
    is_problem_or_one_line(fields)


@quick
@given(corners=st.lists(st.tuples(NUMBERS, NUMBERS), max_size=8))
def test_a_polygon_of_any_corners(corners: list[tuple[Any, Any]]) -> None:
    is_problem_or_one_line({**GOOD, "groups": None, "obstacles": [[list(corner) for corner in corners]]})


TEXT = json.dumps(GOOD)


@pytest.mark.parametrize("ending", [".json", ".jsonl"])
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n",
        b"\x00",
        TEXT.encode("utf-8-sig"),
        TEXT.encode("utf-16"),
        TEXT.encode("utf-16-le"),
        TEXT.encode("utf-32"),
        TEXT.replace("curves", "\u00e4").encode("latin-1"),
        TEXT.replace("19.0", "2" * 5_000).encode(),
        TEXT.replace("19.0", "0x14").encode(),
        TEXT.replace('"obstacles"', '"obstacles": []}{"x"').encode(),
        (TEXT[:-1] + ', "class": ' + '{"a":' * 50_000).encode(),
        (TEXT + TEXT).encode(),
        b"[" + TEXT.encode() + b"]",
    ],
)
def test_a_text_that_is_no_problem_is_refused_in_one_line(
    tmp_path: Path, ending: str, content: bytes
) -> None:
    path = tmp_path / f"p{ending}"
    path.write_bytes(content)
    if ending == ".jsonl" and not content.strip():
        assert read_problems(path) == []
        return
    with pytest.raises(StorageError, match=str(path)) as error:
        read_problems(path)
    assert "\n" not in str(error.value)


def test_a_byte_order_mark_is_called_one(tmp_path: Path) -> None:
    (tmp_path / "p.json").write_text(TEXT, encoding="utf-8-sig")
    with pytest.raises(StorageError, match="begins with a byte order mark; save it as UTF-8 without one"):
        read_problems(tmp_path / "p.json")
