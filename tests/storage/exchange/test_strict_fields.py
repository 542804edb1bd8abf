"""Files say nothing that is not understood: no unknown field, and none twice."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.errors import StorageError
from storage.exchange.plans import PlanRecord, read_plan, write_plan
from storage.exchange.problem_files import FIELDS, FORMATS
from storage.exchange.problems import fields_of, read_problems
from storage.fields import check_fields, parse_json
from tests.storage.samples import box, plan, problem_with, quick

GOOD: dict[str, Any] = fields_of(problem_with([box(20, 20)]))
LATER = ("goal_heading", "start_velocity", "driver")


def write(path: Path, fields: dict[str, Any]) -> Path:
    if path.suffix == ".parquet":
        pq.write_table(pa.Table.from_pylist([fields]), path)
    else:
        path.write_text(json.dumps(fields) + "\n")
    return path


def refusal(path: Path) -> str:
    with pytest.raises(StorageError) as error:
        (read_plan if path.name == "plan.json" else read_problems)(path)
    text = str(error.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    assert len(text) < 500 + len(str(path))
    return text


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize(
    ("name", "nearest"), [("obstacels", "obstacles"), ("Goal", "goal"), ("goal-radius", "goal_radius")]
)
def test_a_misspelt_field_is_refused_with_the_nearest_name(
    tmp_path: Path, ending: str, name: str, nearest: str
) -> None:
    told = refusal(write(tmp_path / f"p{ending}", {**GOOD, name: GOOD[nearest]}))
    assert repr(name) in told
    assert repr(nearest) in told


@pytest.mark.parametrize("name", LATER)
def test_a_field_that_is_not_supported_is_refused_and_those_that_are_are_named(
    tmp_path: Path, name: str
) -> None:
    told = refusal(write(tmp_path / "p.json", {**GOOD, name: 1.0}))
    assert repr(name) in told
    assert all(each in told for each in FIELDS)


@quick
@given(name=st.text().filter(lambda name: name not in FIELDS))
def test_any_other_name_is_refused_in_one_line(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    refusal(write(tmp_path_factory.getbasetemp() / "p.json", {**GOOD, name: None}))


@pytest.mark.parametrize("ending", [".json", ".jsonl"])
@pytest.mark.parametrize("name", ["obstacles", "id", "groups"])
def test_a_field_that_is_there_twice_is_refused(tmp_path: Path, ending: str, name: str) -> None:
    path = tmp_path / f"p{ending}"
    path.write_text(f'{json.dumps(GOOD)[:-1]}, "{name}": [], "{name}": []}}')
    assert f"{name!r} more than once" in refusal(path)


@given(
    pairs=st.lists(
        st.tuples(
            st.sampled_from(["a", "b", 'a"', "a\\"]),
            st.sampled_from(['"x"', '"\\""', "1", "[2, [3.5]]", '{"b": "a"}']),
        ),
        max_size=4,
    )
)
def test_an_object_is_read_as_json_says_but_for_fields_that_are_there_twice(
    pairs: list[tuple[str, str]],
) -> None:
    text = "{" + ", ".join(f"{json.dumps(name)}: {value}" for name, value in pairs) + "}"
    for given_text in (text, text.encode()):
        if len({name for name, _ in pairs}) < len(pairs):
            with pytest.raises(StorageError, match="more than once"):
                parse_json(given_text, "it")
        else:
            assert parse_json(given_text, "it") == json.loads(text)


def test_a_column_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    table = pa.Table.from_pylist([GOOD])
    pq.write_table(table.append_column("obstacles", pa.array([[]])), tmp_path / "p.parquet")
    assert "'obstacles' more than once" in refusal(tmp_path / "p.parquet")


def test_a_plan_says_nothing_unknown_and_nothing_twice(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    write_plan(path, PlanRecord("p-1", "solved", "searched", "gust", "none", 0.1, plan(5)))
    good = path.read_text()
    write(path, {**json.loads(good), "scales": 2.0})
    assert "'scales'" in refusal(path)
    assert "'scale'" in refusal(path)
    path.write_text(f'{good.rstrip()[:-1]}, "states": []}}')
    assert "'states' more than once" in refusal(path)


def test_a_name_may_be_anything() -> None:
    for name in (1, None, ("a",), "x" * 10_000_000):
        with pytest.raises(ValueError, match="unknown field") as error:
            check_fields({name: 1}, ["start"])
        assert len(str(error.value)) < 300
