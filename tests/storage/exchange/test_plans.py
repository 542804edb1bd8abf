from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, VEHICLES
from storage.errors import StorageError
from storage.exchange.plans import FIELDS, PlanRecord, read_plan, write_plan
from tests.storage.samples import plan, quick, same_plan

RECORD = PlanRecord("p-1", "solved", "repaired", "gust", "open", 0.012, plan(20))


def test_a_plan_comes_back_exactly(tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.json", RECORD)
    read = read_plan(tmp_path / "plan.json")
    assert RECORD.plan is not None
    assert read.plan is not None
    assert same_plan(read.plan, RECORD.plan)
    assert replace(read, plan=None).__dict__ == replace(RECORD, plan=None).__dict__


def test_the_file_has_exactly_the_fields_of_the_contract(tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.json", RECORD)
    found = json.loads((tmp_path / "plan.json").read_text())
    assert list(found) == [
        "problem_id", "status", "source", "planner", "assist", "vehicle", "dt", "states", "controls",
        "planning_seconds", "length_m", "duration_s",
    ]  # fmt: skip
    assert RECORD.plan is not None
    assert found["states"] == RECORD.plan.states.tolist()
    assert found["duration_s"] == pytest.approx(1.9)


def test_a_plan_far_from_the_origin_comes_back_in_its_own_frame(tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.json", replace(RECORD, offset=(4_484_378_811.0, -354_286_007.0)))
    assert RECORD.plan is not None
    written = np.array(json.loads((tmp_path / "plan.json").read_text())["states"])
    near = written - [4_484_378_811.0, -354_286_007.0, 0.0, 0.0, 0.0]
    assert np.allclose(near, RECORD.plan.states, rtol=0.0, atol=5e-7)
    read = read_plan(tmp_path / "plan.json")
    assert read.plan is not None
    assert read.offset == tuple(np.round(written[0, :2]).tolist())
    assert np.allclose(read.plan.states[:, :2] + read.offset, written[:, :2], rtol=0.0, atol=5e-7)


def test_a_file_holds_the_lengths_outside_and_says_the_scale(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    write_plan(path, replace(RECORD, scale=0.5))
    found = json.loads(path.read_text())
    assert RECORD.plan is not None
    assert found["scale"] == 0.5
    assert found["length_m"] == pytest.approx(0.5 * RECORD.plan.length_m)
    assert found["states"][3][:2] == (0.5 * RECORD.plan.states[3, :2]).tolist()
    assert found["states"][3][4] == RECORD.plan.states[3, 4]
    read = read_plan(path)
    assert read.plan is not None
    assert read.scale == 0.5
    assert same_plan(read.plan, RECORD.plan)
    for scale in (0.0, -1.0, 1e-320, 1e308, math.nan, 10**400):
        path.write_text(json.dumps(found | {"scale": scale}))
        with pytest.raises(StorageError, match="scale is"):
            read_plan(path)


@pytest.mark.parametrize("name", VEHICLES)
def test_a_plan_is_only_read_for_its_vehicle(tmp_path: Path, name: str) -> None:
    vehicle = VEHICLES[name]
    path = tmp_path / "plan.json"
    write_plan(path, replace(RECORD, plan=plan(20, 3, vehicle), vehicle=vehicle))
    read = read_plan(path, vehicle)
    assert read.plan is not None
    assert same_plan(read.plan, plan(20, 3, vehicle))
    for other in VEHICLES:
        if other != name:
            with pytest.raises(StorageError, match=f"for vehicle {name}, expected {other}: .*; use"):
                read_plan(path, VEHICLES[other])


def test_a_plan_that_names_no_vehicle_is_the_cars(tmp_path: Path) -> None:
    """Files were once of the car alone."""
    path = tmp_path / "plan.json"
    write_plan(path, RECORD)
    found = json.loads(path.read_text())
    del found["vehicle"]
    path.write_text(json.dumps(found))
    assert read_plan(path).vehicle == CAR
    with pytest.raises(StorageError, match="for vehicle car, expected car-1-trailer"):
        read_plan(path, CAR_1_TRAILER)


def test_an_attempt_without_a_plan_can_be_written(tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.json", replace(RECORD, plan=None, status="time-spent", source=None))
    read = read_plan(tmp_path / "plan.json")
    assert (read.plan, read.source, read.status) == (None, None, "time-spent")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"states": [[1, 2, 3], [1, 2, 3]], "controls": [[0, 0]]}, r"states \[2, 3\].*another vehicle"),
        ({"states": [[1, 2, 3, 4, 5]]}, "another vehicle"),
        ({"states": [[1, 2, 3, 4, 5], [1, 2]]}, "rows of numbers"),
        ({"states": "none"}, "rows of numbers"),
        ({"states": [["1", "2", "3", "4", "5"]], "controls": []}, "rows of numbers"),
        ({"states": [[1, 2, 3, 4, 10**400]], "controls": []}, "rows of numbers"),
        ({"states": [[1, 2, 3, 4, float("nan")]], "controls": []}, "not a finite number"),
        ({"states": [[1e300, 2, 3, 4, 5]], "controls": []}, "not a finite number"),
        *[({"dt": dt}, "dt") for dt in (None, "0.1", 0.0, -0.1, 1e-320, math.nan, math.inf, 0.2)],
        ({"problem_id": 7}, "problem_id must be printable text"),
        ({"source": ["searched"]}, "source must be printable text"),
        ({"planning_seconds": None}, "planning_seconds must hold numbers"),
    ],
)
def test_a_file_that_is_no_plan_is_refused_in_one_line(
    tmp_path: Path, change: dict[str, Any], reason: str
) -> None:
    path = tmp_path / "plan.json"
    write_plan(path, RECORD)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(StorageError, match=reason) as error:
        read_plan(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["[]", "7", "null", '"plan"', "[[0.0]]", "", "{", "[" * 100_000, "\ufeff{}"])
def test_what_is_no_object_is_no_plan(tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(StorageError, match=r"plan\.json") as error:
        read_plan(tmp_path / "plan.json")
    assert "\n" not in str(error.value)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=12,
)


@quick
@given(name=st.sampled_from(FIELDS), value=VALUES)
def test_whatever_a_field_holds_it_is_a_plan_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, name: str, value: object
) -> None:
    path = tmp_path_factory.getbasetemp() / "plan.json"
    write_plan(path, RECORD)
    path.write_text(json.dumps({**json.loads(path.read_text()), name: value}))
    try:
        read = read_plan(path)
    except StorageError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert read.plan is None or np.isfinite(read.plan.states).all()


def test_a_missing_field_is_named(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text("{}")
    with pytest.raises(StorageError, match="'states'"):
        read_plan(tmp_path / "plan.json")
