"""Every command's JSON is as docs/commands.md says: the fields of its answer, and those of its tables."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dashboards.report import retrieval_tables, tables
from dashboards.verdicts import comparison_tables, promotion
from flows.cli.main import call
from storage.exchange.problems import fields_of, write_problems
from storage.places.data_folder import open_data_folder
from tasks.champions import dry_run
from tasks.requests import optimise_one
from tests.tasks.served import problem, write_memory
from tests.worlds import problem_of

PAGE = (Path(__file__).parents[3] / "docs" / "commands.md").read_text(encoding="utf-8")
ROWS = [line.strip("|").split(" | ") for line in PAGE.splitlines() if line.startswith("| `")]
NAMES = re.compile(r"`([^`]+)`")
ANSWERS = {
    name: NAMES.findall(told.partition(";")[0])
    for names, told in (row for row in ROWS if len(row) == 2 and row[1].startswith("`"))
    for name in NAMES.findall(names)
}
TABLES = [
    (NAMES.findall(row[0])[0], NAMES.findall(row[1]), NAMES.findall(row[2])) for row in ROWS if len(row) == 3
]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a memory, problems and a map."""
    place = tmp_path_factory.mktemp("answers")
    write_memory(place / "memory")
    (place / "one.json").write_text(json.dumps(fields_of(problem(0))))
    (place / "few.jsonl").write_text("\n".join(json.dumps(fields_of(problem(i))) for i in range(3)))
    write_problems(place / "empty.parquet", [problem_of([], "empty")])
    blocked = {"start": [0, 0, 0], "goal": [30, 0], "bounds": [-9, -9, 40, 9], "id": "walled"}
    (place / "walled.json").write_text(
        json.dumps(blocked | {"obstacles": [[[9, -9], [10, -9], [10, 9], [9, 9]]]})
    )
    np.save(place / "town.npy", np.zeros((160, 160), np.uint8))
    return place


def _told(words: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, code: int = 0) -> Any:
    monkeypatch.chdir(place)
    assert call([*words.split(), "--json"]) == code
    told = json.loads(capsys.readouterr().out)
    assert list(told) == ["exit_code", "answer", "tables", "lines", "files", "warnings", "error"]
    assert told["exit_code"] == code
    assert (told["error"] is None) == (code == 0)
    assert all(Path(path).exists() for path in told["files"].values())
    name = words.split()[0]
    assert told["answer"] is None or sorted(told["answer"]) == sorted(ANSWERS.get(name, []))
    for table in told["tables"]:
        shapes = [fields for known, of, fields in TABLES if known == table["name"] and name in of[0]]
        assert all(list(row) in shapes for row in table["rows"]), table
    return told


def test_nothing_is_called_faultless_where_nothing_was_judged(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    for name, code in (("walled", 1), ("one", 0)):
        _told(
            f"solve {name}.json --planner gust --out {name}.parquet --plans {name}",
            place,
            monkeypatch,
            capsys,
        )
        _told(f"verify {name}", place, monkeypatch, capsys, code)


@pytest.mark.parametrize(
    ("words", "names", "files"),
    [
        ("draw parallel --problems 2 --out drawn.jsonl", [], ["problems"]),
        ("plan one.json --memory memory --explain", ["recalled"], []),
        ("plan one.json --out plan.json --picture plan.png", [], ["plan", "picture"]),
        ("optimise empty.parquet --straight", [], []),
        ("solve few.jsonl --out rows.parquet --plans plans", [], ["rows", "plans"]),
        ("import-worlds town.npy --problems 2 --out town.jsonl", ["import"], ["problems"]),
        ("gather few.jsonl --plans 2 --workers 1 --out library", ["gather"], ["library"]),
        ("adapt memory --vehicle car --out adapted", [], ["memory"]),
        ("route town.npy --from 20,20,0 --to 120,120 --out route.json", ["legs"], ["plan"]),
        ("export plan.json --format dynobench --out trajectory.yaml", [], ["exported"]),
    ],
)
def test_a_command_tells_programs_what_is_documented(
    words: str,
    names: list[str],
    files: list[str],
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if words.startswith("export"):
        _told("plan one.json --out plan.json", place, monkeypatch, capsys)
    told = _told(words, place, monkeypatch, capsys)
    assert [table["name"] for table in told["tables"]] == names
    assert list(told["files"]) == files


@pytest.mark.parametrize("command", ["plan", "optimise"])
def test_the_problem_that_is_picked_is_the_one_that_is_answered(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = _told(f"{command} few.jsonl --pick 2", place, monkeypatch, capsys)
    assert told["answer"]["problem_id"] == problem(1).id


@pytest.mark.parametrize(("east", "stated"), [(0.0, {}), (5_000.0, {"vehicle": "car"})])
def test_who_drives_a_plan_is_given_what_is_left_of_it_unless_another_is_quicker(
    east: float,
    stated: dict[str, str],
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    asked = json.loads((place / "one.json").read_text()) | stated
    for name in ("start", "goal"):
        asked[name][0] += east
    asked["bounds"] = [low + (0.0 if axis % 2 else east) for axis, low in enumerate(asked["bounds"])]
    asked["obstacles"] = [[[x + east, y] for x, y in polygon] for polygon in asked["obstacles"]]
    (place / "asked.json").write_text(json.dumps(asked))
    first = _told("plan asked.json --out driven.json", place, monkeypatch, capsys)["answer"]
    driven = json.loads((place / "driven.json").read_text())
    x, y, heading, speed, steering = driven["states"][20]
    moved = asked | {"start": [x, y, heading], "start_speed": speed, "start_steering": steering}
    (place / "moved.json").write_text(json.dumps(moved))
    again = _told("plan moved.json --current driven.json", place, monkeypatch, capsys)["answer"]
    assert again["duration_s"] <= first["duration_s"] - 20 * first["dt"] + 1e-9
    assert (first["near_current"], again["near_current"]) == (None, True)
    worse = "plan moved.json --planner gust --unpolished"  # which finds nothing as quick
    assert _told(f"{worse} --current driven.json", place, monkeypatch, capsys)["answer"]["source"] == "kept"


def test_who_is_elsewhere_is_told_that_the_current_plan_is_left_aside(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _told("plan one.json --out driven.json", place, monkeypatch, capsys)
    turned = {"start": [0.0, 0.0, -2.4], "goal": [-20.0, -20.0], "bounds": [-40, -40, 9, 9], "obstacles": []}
    (place / "turned.json").write_text(json.dumps(turned))
    told = _told("plan turned.json --current driven.json", place, monkeypatch, capsys)
    assert told["answer"]["near_current"] is False
    assert ["driven.json" in warning for warning in told["warnings"]] == [True]


@pytest.mark.parametrize(
    ("changes", "code", "why"),
    [
        ({"status": "exhausted", "states": [], "controls": []}, 2, "holds no plan"),
        ({"scale": 2.0}, 2, "scale"),
        ({"dt": 0.2}, 1, "dt"),
    ],
)
def test_a_current_plan_that_cannot_be_driven_on_is_refused(
    changes: dict[str, Any],
    code: int,
    why: str,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    _told("plan one.json --out driven.json", place, monkeypatch, capsys)
    driven = json.loads((place / "driven.json").read_text())
    (place / "other.json").write_text(json.dumps(driven | changes))
    told = _told("plan one.json --current other.json", place, monkeypatch, capsys, code)
    assert why in told["error"]


@pytest.mark.parametrize(
    ("asked", "blocked"),
    [
        ("plan one.json", "plan walled.json"),
        ("route town.npy --from 20,20,0 --to 120,120", "route town.npy --from 20,20,0 --to 900,120"),
    ],
)
def test_a_plan_takes_the_place_of_the_one_that_is_driven_and_nothing_else_does(
    asked: str, blocked: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def states() -> Any:
        return json.loads((place / "driven.json").read_text())["states"]

    monkeypatch.chdir(place)
    assert call([*asked.split(), "--unpolished", "--out", "driven.json"]) == 0
    first = states()
    again = ["--current", "driven.json", "--out", "driven.json"]
    assert call([*asked.split(), *again]) == 0
    second = states()
    assert 0 < len(second) < len(first)
    assert call([*blocked.split(), *again]) in (1, 2)
    assert states() == second


def test_the_parts_of_a_plan_are_numbers_and_its_states_are_there_once(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = _told("plan one.json", place, monkeypatch, capsys)["answer"]
    assert answer["verified"] is True
    assert sum(answer["parts_seconds"].values()) <= answer["planning_seconds"]
    assert len(answer["states"]) == answer["waypoints"] == len(answer["controls"]) + 1
    assert answer["duration_s"] == pytest.approx(answer["dt"] * len(answer["controls"]))
    states = np.array(answer["states"])
    turns = np.abs(np.diff(np.unwrap(states[:, 2]))) / answer["dt"]
    fastest = np.maximum(np.abs(states[:-1, 3]), np.abs(states[1:, 3]))
    assert 0.0 < answer["lateral_acceleration"] <= np.max(turns * fastest) + 1e-9
    told = _told("plan one.json --out kept.json", place, monkeypatch, capsys)
    assert told["answer"]["states"] is None
    kept = json.loads(Path(told["files"]["plan"]).read_text())
    assert (kept["states"], kept["controls"]) == (answer["states"], answer["controls"])


def test_no_plan_is_an_answer_too(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = _told("plan walled.json --planner gust", place, monkeypatch, capsys, code=1)["answer"]
    assert answer["status"] != "solved"
    assert (answer["source"], answer["length_m"], answer["verified"], answer["states"]) == (
        None,
        None,
        None,
        [],
    )


@pytest.mark.parametrize("command", ["plan walled.json --planner gust", "optimise walled.json --straight"])
def test_without_a_plan_an_older_one_is_kept(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    older = place / "older.json"
    older.write_text('{"states": [], "controls": []}')
    told = _told(f"{command} --out older.json", place, monkeypatch, capsys, code=1)
    assert older.read_text() == '{"states": [], "controls": []}'
    assert told["files"] == {}
    assert "older.json" in told["error"]
    (place / "newer.json").unlink(missing_ok=True)
    _told(f"{command} --out newer.json", place, monkeypatch, capsys, code=1)
    assert json.loads((place / "newer.json").read_text())["status"] != "solved"


@pytest.mark.parametrize("notes", ['{"my": "notes"}', "no JSON"])
def test_a_file_that_is_no_plan_is_never_replaced_by_one(
    notes: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (place / "notes.json").write_text(notes)
    told = _told("plan one.json --out notes.json", place, monkeypatch, capsys, code=2)
    assert "notes.json" in told["error"]
    assert (place / "notes.json").read_text() == notes


@pytest.mark.parametrize(
    "command", ["plan one.json", "optimise empty.parquet", "route town.npy --from 20,20,0 --to 120,120"]
)
def test_a_plan_is_written_under_no_name_but_that_of_a_plan(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = _told(f"{command} --out plan.txt", place, monkeypatch, capsys, code=2)
    assert "plan.txt" in told["error"]
    assert ".json" in told["error"]
    assert not (place / "plan.txt").exists()


@pytest.mark.parametrize(
    ("name", "command", "headings", "fields"),
    [
        ("summary", "run", tables._HEADINGS, tables._FIELDS),
        ("retrieval", "report", retrieval_tables.RETRIEVAL_HEADINGS, retrieval_tables._RETRIEVAL_FIELDS),
        ("stages", "report", tables.STAGE_HEADINGS, tables._STAGE_FIELDS),
        ("sweep", "sweep", tables._SWEEP_HEADINGS, tables._SWEEP_FIELDS),
        ("comparison", "compare", comparison_tables.HEADINGS, comparison_tables.FIELDS),
        (
            "comparison",
            "compare --measure",
            comparison_tables.HEADINGS_IN_TURN,
            comparison_tables.FIELDS_IN_TURN,
        ),
        ("judgement", "retrain", promotion.HEADINGS, promotion.FIELDS),
        ("retraining", "retrain --dry-run", dry_run.HEADINGS, dry_run.FIELDS),
    ],
)
def test_the_tables_of_runs_are_documented(
    name: str, command: str, headings: tuple[str, ...], fields: tuple[str, ...]
) -> None:
    (documented,) = [told for known, of, told in TABLES if known == name and command in of]
    assert tuple(each for each in documented if each != "panel") == fields
    assert len(headings) == len(fields)


@pytest.mark.parametrize(
    "words",
    ["plan one.json", "solve few.jsonl --out rows.parquet", "optimise empty.parquet --straight",
     "route town.npy --from 20,20,0 --to 120,120", "retrain-library lots lot --data new --dry-run"],
)  # fmt: skip
def test_people_are_told_the_vehicle_and_where_it_is_the_default(
    words: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    found: list[Any] = []  # a second to optimise: once is enough

    def once(*asked: Any, optimise: Any = optimise_one.optimise_one) -> Any:
        found.extend([] if found else [optimise(*asked)])
        return found[0]

    monkeypatch.setattr(optimise_one, "optimise_one", once)
    assumed = "vehicle  car, the default; --vehicle names another"
    takes_memory = words.split()[0] in ("plan", "solve", "route")
    with_memory = [(["--memory", "memory"], "vehicle  car")] if takes_memory else []
    for more, line in [([], assumed), (["--vehicle", "car"], "vehicle  car"), *with_memory]:
        assert call([*words.split(), *more]) == 0
        assert line in capsys.readouterr().out.splitlines()
    for more in (["--json"], ["--quiet"]):
        assert call([*words.split(), *more]) == 0
        assert "--vehicle names" not in capsys.readouterr().out


@pytest.mark.parametrize("words", ["plan one.json", "route town.npy --from 20,20,0 --to 120,120"])
def test_an_answer_is_told_where_it_cannot_be_learned(
    words: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    full = open_data_folder(place / f"full-{words.split()[0]}").path
    (full / "learned").touch()  # where there should be a folder
    assert call([*words.split(), "--learn", str(full), "--json", "--picture", "learned.png"]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["answer"]["status"] == "solved"
    assert [str(full) in warning for warning in told["warnings"]] == [True]
    assert told["files"] == {"picture": "learned.png"}


def test_the_vehicle_that_a_problem_states_is_no_default(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    (place / "stated.json").write_text(json.dumps(fields_of(problem(0)) | {"vehicle": "car"}))
    for command in (
        ["plan", "stated.json"],
        ["gather", "stated.json", "--out", "of-stated", "--workers", "1"],
        ["retrain-library", "lots", "stated.json", "--data", "new", "--dry-run"],
    ):
        assert call(command) == 0
        assert "vehicle  car" in capsys.readouterr().out.splitlines()
