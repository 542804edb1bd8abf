from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.plans.experience import Experience
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, VEHICLES, Vehicle, name_of
from storage.errors import StorageError
from storage.tables.attempts import (
    attempt_columns,
    attempt_records,
    join_attempts,
    read_attempts,
    readable_attempts,
    write_attempts,
)
from storage.tables.experiences import merge_experiences, read_experiences, write_experiences
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled, write_hallucinated
from storage.tables.recalls import read_recalls, write_recalls
from storage.tables.schemas import ATTEMPTS
from tests.storage.samples import box, experiences, plan, problem_with, quick, same_plan, same_problem

OTHERS = [vehicle for vehicle in VEHICLES.values() if vehicle != CAR]


def store(path: Path, found: list[Experience], key: str = "k", vehicle: Vehicle = CAR) -> None:
    planners, times = ["rrt"] * len(found), [0.5] * len(found)
    seeds = range(len(found))
    write_experiences(
        path, found, planners=planners, seeds=seeds, planning_seconds=times, key=key, vehicle=vehicle
    )


def same(one: list[Experience], other: list[Experience]) -> bool:
    return len(one) == len(other) and all(
        same_problem(a.problem, b.problem) and same_plan(a.plan, b.plan)
        for a, b in zip(one, other, strict=True)
    )


@quick
@given(found=st.lists(experiences, max_size=4))
def test_experiences_come_back_exactly_and_give_the_same_bytes(
    tmp_path_factory: pytest.TempPathFactory, found: list[Experience]
) -> None:
    path = tmp_path_factory.getbasetemp() / "experiences.parquet"
    store(path, found)
    before = path.read_bytes()
    read = read_experiences(path)
    assert same(found, read)
    store(path, read)
    assert path.read_bytes() == before


def test_merged_shards_hold_the_chosen_rows_in_their_order(tmp_path: Path) -> None:
    found = [Experience(problem_with([box(20 + i, 20)], identity=f"p-{i}"), plan(5 + i)) for i in range(5)]
    shards = [tmp_path / "0000.parquet", tmp_path / "0001.parquet"]
    store(shards[0], found[:3], "a")
    store(shards[1], found[3:], "b")
    merge_experiences(shards, tmp_path / "all.parquet", [4, 0, 2], "all")
    assert same(read_experiences(tmp_path / "all.parquet"), [found[i] for i in (4, 0, 2)])
    with pytest.raises(StorageError, match="more than the 5 rows that exist; run collect"):
        merge_experiences(shards, tmp_path / "all.parquet", [0, 5])
    with pytest.raises(StorageError, match="run collect"):
        merge_experiences([], tmp_path / "none.parquet", [])


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_states_are_as_wide_as_the_vehicle_needs(tmp_path: Path, vehicle: Vehicle) -> None:
    found = [Experience(problem_with(), plan(3 + i, i, vehicle), vehicle) for i in range(3)]
    store(tmp_path / "e.parquet", found, vehicle=vehicle)
    read = read_experiences(tmp_path / "e.parquet", vehicle)
    assert same(read, found)
    assert {experience.vehicle for experience in read} == {vehicle}


@pytest.mark.parametrize("wanted", [*OTHERS, CAR._replace(width=1.2)])
def test_experiences_of_another_vehicle_are_refused_by_name(tmp_path: Path, wanted: Vehicle) -> None:
    store(tmp_path / "e.parquet", [Experience(problem_with(), plan(3))])
    with pytest.raises(StorageError, match="was made for vehicle car, expected ") as error:
        read_experiences(tmp_path / "e.parquet", wanted)
    assert name_of(wanted) in str(error.value)
    assert "--vehicle car" in str(error.value)
    assert "\n" not in str(error.value)


def test_experiences_of_two_vehicles_are_not_merged(tmp_path: Path) -> None:
    shards = [tmp_path / "0000.parquet", tmp_path / "0001.parquet"]
    for shard, vehicle in zip(shards, (CAR, CAR_1_TRAILER), strict=True):
        store(shard, [Experience(problem_with(), plan(3, 0, vehicle), vehicle)], vehicle=vehicle)
    with pytest.raises(StorageError, match="several vehicles"):
        merge_experiences(shards, tmp_path / "all.parquet", [0, 1])


def test_what_was_written_when_there_was_but_the_car_is_read(tmp_path: Path) -> None:
    """Its metadata, as the files of that time have it."""
    path = tmp_path / "e.parquet"
    found = [Experience(problem_with(), plan(4))]
    store(path, found)
    table = pq.read_table(path)
    assert table.schema.metadata[b"schema"] == b"experiences/1"
    car = (
        b'{"front": 1.8, "rear": 0.2, "width": 0.9, "wheelbase": 1.6, "max_steering": 0.6981317007977318, '
        b'"min_speed": -1.0, "max_speed": 4.0, "max_acceleration": 2.0, "max_steering_rate": 1.6, "dt": 0.1}'
    )
    pq.write_table(table.replace_schema_metadata({**table.schema.metadata, b"vehicle": car}), path)
    assert same(read_experiences(path), found)


@quick
@given(count=st.integers(0, 20), plans=st.integers(1, 20), seed=st.integers(0, 99))
def test_labelled_problems_come_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, count: int, plans: int, seed: int
) -> None:
    paths = [tmp_path_factory.getbasetemp() / "labelled" / f"{i}.parquet" for i in range(2)]
    rng = np.random.default_rng(seed)
    cells = rng.random((count, 64, 64)) < 0.3
    labels = rng.random((count, plans)) < 0.5
    plan_index = rng.integers(-1, plans, count)
    problems = [problem_with([box(20 + i, 25)], identity=f"h-{i}") for i in range(count)]
    for path in paths:
        write_hallucinated(
            path,
            problems,
            plan_index=plan_index,
            methods=["rearrange"] * count,
            grids=np.packbits(cells.reshape(count, 4096), axis=1),
            labels=np.packbits(labels, axis=1),
            plans=plans,
        )
    read = read_labelled(paths)
    assert read.plans == plans
    assert np.array_equal(
        np.unpackbits(read.grids, axis=1).reshape(-1, 64, 64), np.concatenate([cells, cells])
    )
    assert np.array_equal(np.unpackbits(read.labels, axis=1, count=plans), np.concatenate([labels, labels]))
    assert read.plan_index.dtype == np.int32
    assert np.array_equal(read.plan_index, np.tile(plan_index, 2))
    assert all(map(same_problem, problems, read_hallucinated_problems(paths[0])))
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_shards_labelled_for_other_plans_do_not_mix(tmp_path: Path) -> None:
    for plans in (8, 9):
        write_hallucinated(
            tmp_path / f"{plans}.parquet",
            [],
            plan_index=[],
            methods=[],
            grids=np.empty((0, 512), np.uint8),
            labels=np.empty((0, (plans + 7) // 8), np.uint8),
            plans=plans,
        )
    with pytest.raises(StorageError, match="labelled for 9 plans"):
        read_labelled([tmp_path / "8.parquet", tmp_path / "9.parquet"])
    with pytest.raises(StorageError, match="run hallucinate"):
        read_labelled([])


def test_unpacked_bits_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="pack the bits"):
        write_hallucinated(
            tmp_path / "h.parquet",
            [problem_with()],
            plan_index=[0],
            methods=["rearrange"],
            grids=np.zeros((1, 4096), np.uint8),
            labels=np.zeros((1, 1), np.uint8),
            plans=3,
        )
    assert not (tmp_path / "h.parquet").exists()


ATTEMPT: dict[str, Any] = {
    "problem_id": "curves-standard-0-1",
    "problem_class": "curves",
    "planner": "rrt",
    "assist": "open",
    "top_k": 5,
    "memory": "curves",
    "status": "solved",
    "solved": True,
    "source": "recalled",
    "planning_seconds": 0.001,
    **{f"{part}_seconds": 0.0001 for part in ("occupancy", "encode", "recall", "check", "roadmap", "search")},
    "recalled": (3, 1, 2),
    "collision_checks": 100,
    "expansions": 10,
    "nodes": 50,
    "length_m": 71.5,
    "duration_s": 20.0,
    "seed": 1,
    "run_id": "r",
    "commit": "c",
    "host": "h",
}
FAILED = {
    **ATTEMPT,
    "status": "time-spent",
    "solved": False,
    "source": None,
    "recalled": (),
    "length_m": None,
    "duration_s": None,
}


def test_attempts_of_a_folder_come_back_in_the_order_of_their_files(tmp_path: Path) -> None:
    (tmp_path / "curves").mkdir()
    write_attempts(tmp_path / "curves" / "0001.parquet", [FAILED])
    write_attempts(tmp_path / "curves" / "0000.parquet", [ATTEMPT, {**ATTEMPT, "verified": True}])
    (tmp_path / "curves" / ".0002.parquet.abc.partial").write_text("half")
    frame = read_attempts(tmp_path)
    added = ["scene_seconds", "guide_seconds", "repair_seconds", "verified", "vehicle", "recall", "hit"]
    assert list(frame.columns) == [*ATTEMPT, *added, "polished"]
    assert frame["solved"].tolist() == [True, True, False]
    assert frame["recalled"][0].tolist() == [3, 1, 2]
    assert frame["planning_seconds"].tolist() == [0.001] * 3
    assert np.isnan(frame["length_m"][2])
    assert frame["verified"][1] is True
    assert len(read_attempts(tmp_path / "curves" / "0001.parquet")) == 1


OPTIONAL = [field for field in ATTEMPTS if field.metadata]


def test_columns_that_earlier_versions_did_not_write_are_read_as_missing_values(tmp_path: Path) -> None:
    paths = [tmp_path / "0000.parquet", tmp_path / "0001.parquet"]
    for path in paths:
        write_attempts(path, [{**ATTEMPT, "hit": True, "vehicle": "car"}, FAILED])
    pq.write_table(pq.read_table(paths[0]).drop_columns([field.name for field in OPTIONAL]), paths[0])
    assert len(OPTIONAL) > 4
    for field in OPTIONAL:
        assert attempt_columns(paths[0], [field.name, "seed"]) == {field.name: [None, None], "seed": [1, 1]}
    rows, now = (read_attempts(path) for path in (tmp_path, paths[1]))
    assert list(rows.columns) == list(now.columns)
    assert rows["hit"].tolist() == [None, None, True, None]
    assert np.isnan(rows["scene_seconds"][:2]).all()
    readable, faults = readable_attempts(tmp_path, ["hit", "planner"])
    assert (readable["hit"].tolist(), faults) == ([None, None, True, None], [])
    join_attempts(tmp_path / "all.parquet", paths)
    assert len(read_attempts(tmp_path / "all.parquet")) == 4
    assert set(attempt_records(paths[0])[0]) == set(ATTEMPTS.names)


def test_a_column_that_each_version_wrote_is_not_made_up(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_attempts(path, [ATTEMPT])
    pq.write_table(pq.read_table(path).drop_columns(["solved"]), path)
    with pytest.raises(StorageError, match="solved"):
        read_attempts(path)


def test_a_folder_without_attempts_says_what_to_run(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="holds no rows; run benchmark"):
        read_attempts(tmp_path)


@pytest.mark.parametrize("change", [{"more": 1}, {"solved": "yes"}, {"top_k": 2**40}, {"problem_id": 3}])
def test_an_attempt_of_another_shape_is_refused_and_nothing_written(
    tmp_path: Path, change: dict[str, Any]
) -> None:
    with pytest.raises(StorageError, match=r"^attempt"):
        write_attempts(tmp_path / "a.parquet", [{**ATTEMPT, **change}])
    with pytest.raises(StorageError, match="missing fields: host"):
        write_attempts(tmp_path / "a.parquet", [{name: ATTEMPT[name] for name in ATTEMPT if name != "host"}])
    assert list(tmp_path.iterdir()) == []


def test_what_the_first_version_called_centroid_is_the_encoder_today(tmp_path: Path) -> None:
    path, names = tmp_path / "a.parquet", ("centroid", None, "mask")
    rows = [{**ATTEMPT, "recall": name} for name in names]
    write_attempts(path, rows)
    assert attempt_columns(path, ["recall"]) == {"recall": list(names)}
    table = pq.read_table(path)
    pq.write_table(table.replace_schema_metadata({**table.schema.metadata, b"schema": b"attempts/1"}), path)
    assert read_attempts(path)["recall"].dropna().tolist() == ["encoder", "mask"]
    assert attempt_columns(path, ["recall"]) == {"recall": ["encoder", None, "mask"]}


@quick
@given(count=st.integers(1, 10), plans=st.integers(1, 20), seed=st.integers(0, 99))
def test_recalls_come_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, count: int, plans: int, seed: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "recalls.parquet"
    rng = np.random.default_rng(seed)
    rows = [
        {
            "problem_id": f"p-{i}",
            "class": "trap",
            "memory": "trap",
            "protocol": "fresh",
            "order": rng.permutation(plans),
            "free": rng.random(plans) < 0.5,
            "nothing_recalled": bool(i % 2),
            "recall": "encoder",
            "training_seed": i % 3,
            "made_for": i - 1,
        }
        for i in range(count)
    ]
    write_recalls(path, rows, plans=plans)
    frame = read_recalls([path])
    assert set(frame.columns) == set(rows[0])
    for name in set(rows[0]) - {"order", "free"}:
        assert frame[name].tolist() == [row[name] for row in rows]
    assert np.array_equal(np.stack(list(frame["order"])), [row["order"] for row in rows])
    assert np.array_equal(np.stack(list(frame["free"])), [row["free"] for row in rows])
