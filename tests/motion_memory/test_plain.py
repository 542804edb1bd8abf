"""Problems may be given as Python has them: tuples, arrays, NumPy's numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import motion_memory
from motion_memory.plain import plain
from storage.exchange.problems import fields_of
from tests.tasks.served import problem, write_memory

numbers = st.integers(-1000, 1000) | st.floats(-1e3, 1e3, width=32)
values = st.recursive(
    numbers | st.text() | st.none() | st.booleans(), lambda each: st.lists(each, max_size=4)
)
FIELDS = fields_of(problem(1)) | {"start_speed": 1.0, "goal": [50.0, 50.0, 0.75], "goal_radius": None}
WAYS = (tuple, list, lambda value: np.array(value, np.float32), np.array)


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory) -> motion_memory.Memory:
    return motion_memory.load(write_memory(tmp_path_factory.mktemp("plain") / "memory"), warm=False)


def as_in_python(value: Any, data: st.DataObject) -> Any:
    """The same value in a way that Python has for it; of numbers that float32 can hold."""
    if isinstance(value, list):
        parts = [as_in_python(each, data) for each in value]
        are_numbers = bool(value) and all(type(each) is float for each in value)
        return data.draw(st.sampled_from(WAYS if are_numbers else WAYS[:2]))(parts)
    kinds = (float, np.float64, np.float32) if type(value) is float else (lambda same: same,)
    return data.draw(st.sampled_from(kinds))(value)


@given(values)
def test_what_json_holds_stays_as_it_is(value: Any) -> None:
    assert plain({"field": value}) == {"field": value}


@given(st.data())
@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
def test_a_problem_may_hold_tuples_and_arrays(memory: motion_memory.Memory, data: st.DataObject) -> None:
    exact = {**FIELDS, "start": [0.0, 0.0, 0.75]}
    asked = {name: as_in_python(value, data) for name, value in exact.items()}
    read = memory._read(asked)
    expected = memory._read(exact)
    assert fields_of(read) == fields_of(expected)


def test_what_is_malformed_is_still_refused_as_it_was_given(memory: motion_memory.Memory) -> None:
    for wrong in ((1.0,), np.zeros(5), np.zeros((2, 2)), "1, 2", {"x": 1}):
        with pytest.raises(ValueError, match="start must be a list of 3 numbers") as caught:
            memory.plan({**FIELDS, "start": wrong})
        assert caught.value.__context__ is None


def test_what_is_no_plan_is_not_judged(memory: motion_memory.Memory) -> None:
    for wrong in (None, memory, np.zeros((3, 5))):
        with pytest.raises(motion_memory.UsageError, match=r"plan is .*: give the plan of an answer"):
            memory.check(problem(0), wrong)  # type: ignore[arg-type]
