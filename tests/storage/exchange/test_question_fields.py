"""Fields of general questions: any start state, any goal."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.alignment import to_canonical
from planners.world.problem import BOUNDS, Arrival, Problem, obstacles_of, start_state
from planners.world.vehicles.vehicle import CAR, CAR_2_TRAILERS, VEHICLES, About, state_names
from storage.exchange.problem_files import FIELDS, FORMATS
from storage.exchange.problems import fields_of, problem_of, read_problems, write_problems
from tests.storage.samples import quick

GOOD: dict[str, Any] = {
    "start": [10.0, 12.0, 0.3],
    "goal": [20.0, 15.0],
    "bounds": list(BOUNDS),
    "obstacles": [],
}
angles = st.floats(-3.0, 3.0)
small = st.floats(0.01, 1.0)


@st.composite
def questions(draw: st.DrawFn, vehicle_name: str) -> Problem:
    names = state_names(VEHICLES[vehicle_name])[3:]
    motion = [draw(st.floats(-0.6, 0.6)) for _ in range(draw(st.integers(0, len(names))))]
    while motion and motion[-1] == 0.0:
        motion.pop()
    arrival = None
    if draw(st.booleans()):
        speeds = sorted((draw(st.floats(-1.0, 4.0)), draw(st.floats(-1.0, 4.0))))
        pose = (draw(angles), draw(small)) if draw(st.booleans()) else ()
        trailers = len(names) - 2 if draw(st.booleans()) else 0
        arrival = Arrival(*pose)._replace(
            least_speed=speeds[0],
            most_speed=speeds[1],
            hitches=tuple(draw(st.floats(-1.0, 1.0)) for _ in range(trailers)),
            hitch_tolerances=tuple(draw(small) for _ in range(trailers)),
        )
    goal = draw(st.floats(-5.0, 50.0)), draw(st.floats(-5.0, 50.0))
    radius = draw(small)
    motion_given, nothing = tuple(motion), obstacles_of([])
    return Problem(
        "q",
        "questions",
        (10.0, 12.0, draw(angles)),
        goal,
        radius,
        BOUNDS,
        nothing,
        1.0,
        motion_given,
        arrival,
    )


@pytest.mark.parametrize("name", VEHICLES)
@quick
@given(data=st.data(), ending=st.sampled_from(FORMATS))
def test_a_question_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, name: str, data: st.DataObject, ending: str
) -> None:
    vehicle, asked = VEHICLES[name], data.draw(questions(name))
    path = tmp_path_factory.getbasetemp() / f"question{ending}"
    write_problems(path, [asked], vehicle)
    (read,) = read_problems(path, vehicle)
    assert (read.start, read.goal, read.goal_radius) == (asked.start, asked.goal, asked.goal_radius)
    assert (read.start_motion, read.arrival) == (asked.start_motion, asked.arrival)


def test_what_is_left_out_is_as_it_always_was() -> None:
    asked = problem_of(GOOD, "q")
    assert (asked.goal_radius, asked.start_motion, asked.arrival) == (2.0, (), None)
    assert problem_of({**GOOD, "start_speed": 0, "start_steering": 0}, "q").start_motion == ()


def test_a_pose_is_arrived_at_at_rest_unless_it_says_more() -> None:
    assert problem_of({**GOOD, "goal": [20, 15, 1]}, "q").arrival == Arrival(1.0, 0.05, 0.0, 0.0)
    moving = problem_of(
        {**GOOD, "goal": [20, 15, 1], "goal_speed": [1, 2], "goal_tolerance": [0.3, 0.2]}, "q"
    )
    assert (moving.arrival, moving.goal_radius) == (Arrival(1.0, 0.2, 1.0, 2.0), 0.3)


def test_speeds_are_lengths_and_are_scaled() -> None:
    fields = {**GOOD, "start": [1, 1, 0], "goal": [2, 2], "bounds": [0, 0, 9, 9], "scale": 0.25}
    asked = problem_of({**fields, "start_speed": 0.5, "goal_speed": [0, 0.25]}, "q")
    assert asked.start_motion == (2.0,)
    assert asked.arrival == Arrival(least_speed=0.0, most_speed=1.0)
    written = fields_of(asked)
    assert (written["start_speed"], written["goal_speed"]) == (0.5, [0.0, 0.25])


def test_trailers_may_be_bent_at_both_ends() -> None:
    ends = {"start_hitch": [0.4, -0.2], "goal_hitch": [0.1, 0.0], "goal_hitch_tolerance": [0.2, 0.3]}
    asked = problem_of(GOOD | ends, "q", CAR_2_TRAILERS)
    assert asked.start_motion == (0.0, 0.0, 0.4, -0.2)
    assert fields_of(asked, CAR_2_TRAILERS).items() >= ends.items()


junk = st.one_of(
    st.none(),
    st.booleans(),
    st.floats(),
    st.text(max_size=3),
    st.integers(),
    st.lists(st.one_of(st.floats(), st.integers(-9, 9), st.none(), st.text(max_size=2)), max_size=4),
)
names = [*FIELDS, "moving"]


@pytest.mark.parametrize("vehicle", [CAR, CAR_2_TRAILERS])
@quick
@given(changes=st.dictionaries(st.sampled_from(names), junk, min_size=1, max_size=4))
def test_a_malformed_question_is_told_in_one_line(vehicle: Any, changes: dict[str, Any]) -> None:
    try:
        asked = problem_of(GOOD | changes, "q", vehicle)
    except ValueError as error:
        told = str(error)
    else:
        told = ""
        numbers = (*asked.start, *asked.goal, *asked.start_motion, asked.goal_radius)
        assert all(math.isfinite(number) for number in numbers)
        assert json.loads(json.dumps(fields_of(asked, vehicle), allow_nan=False))
    assert "\n" not in told
    assert len(told) < 600


@pytest.mark.parametrize(
    ("goal", "scale", "is_wide"),
    [
        ({}, 0.5, True),
        ({}, 1.0, False),
        ({"goal_radius": 2.0}, 0.5, False),
        ({"goal": [50.0, 50.0, 1.0]}, 0.5, False),
        ({"goal": [50.0, 50.0, 1.0]}, 0.1, True),
        ({"goal": [50.0, 50.0, 1.0], "goal_tolerance": [0.1, 0.05]}, 0.1, False),
    ],
)
def test_a_small_robot_is_told_how_far_from_its_goal_it_may_end_if_that_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, goal: dict[str, Any], scale: float, is_wide: bool
) -> None:
    path = tmp_path / "near.json"
    path.write_text(json.dumps({name: value for name, value in GOOD.items() if name != "goal_radius"} | goal))
    (asked,) = read_problems(path, CAR._replace(scale=scale, front=0.8, about=About(b"small")))
    assert [record.levelname for record in caplog.records] == ["WARNING"] * is_wide
    assert scale * asked.goal_radius == pytest.approx(0.1 if len(goal.get("goal", [])) == 3 else 2.0)


def test_each_kind_of_hint_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rows = [
        {"id": "near"},
        {"id": "turned", "start": [10.0, 12.0, 90.0]},
        {"id": "both", "start": [10.0, 12.0, 45.0]},
    ]
    path = tmp_path / "two.jsonl"
    path.write_text("\n".join(json.dumps(GOOD | row) for row in rows))
    read_problems(path, CAR._replace(scale=0.5, front=0.8))
    told = [record.getMessage() for record in caplog.records]
    assert ["near" in told[0], "turned" in told[1], len(told)] == [True, True, 2]


@pytest.mark.parametrize(
    ("fields", "hinted"),
    [
        ({}, None),
        ({"start": [0.0, 0.0, -math.tau]}, None),
        ({"start": [0.0, 0.0, 45]}, "start heading is 45 rad, more than a full turn; .* 0.7854 rad"),
        ({"start": [0.0, 0.0, -90.5]}, "start heading is -90.5 rad"),
        ({"goal": [50.0, 50.0, math.tau]}, None),
        ({"goal": [50.0, 50.0, 180]}, "goal heading is 180 rad"),
        ({"goal": [50.0, 50.0, 1.0], "goal_tolerance": [0.1, math.pi]}, None),
        ({"goal": [50.0, 50.0, 1.0], "goal_tolerance": [0.1, 5]}, "goal_tolerance is 5 rad"),
    ],
)
@pytest.mark.parametrize("ending", [".jsonl", ".parquet"])
def test_degrees_are_warned_of_once_and_taken_as_the_radians_that_they_may_be(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, fields: dict[str, Any], hinted: str | None, ending: str
) -> None:
    path = tmp_path / f"turned{ending}"
    rows = [GOOD | fields | {"id": name} for name in ("one", "two")]
    if ending == ".jsonl":
        path.write_text("\n".join(map(json.dumps, rows)))
    else:
        pq.write_table(pa.Table.from_pylist(rows), path)
    first, _ = read_problems(path)
    assert first.start[2] == rows[0]["start"][2]
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == (hinted is not None)
    assert hinted is None or re.search(rf"id 'one'\): {hinted}", told[0])


def test_who_cannot_stop_asks_what_memories_answer_unless_it_says_how_fast_it_is() -> None:
    vehicle = CAR._replace(min_speed=1.0, about=About(b"never-stops"))
    asked = to_canonical(problem_of(GOOD, "q", vehicle))[0]
    assert asked.start_motion == ()
    assert start_state(asked, vehicle)[3] == 1.0
    assert problem_of({**GOOD, "start_steering": 0.1}, "q", vehicle).start_motion == (1.0, 0.1)
