"""``import-worlds``: what is written is whole, what is told fits a line, and a run can use it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flows.cli.main import call
from storage.errors import StorageError
from storage.exchange.problems import read_problems, write_problems
from storage.tables.imported_problems import read_imported
from storage.worlds.sources import source_at
from tasks.inputs.problem_sources import source_key, source_of
from tasks.settings.presets import for_preset
from tasks.stages.read_worlds import READ_WORLDS, WorldsRead
from tests.storage.samples import box, problem_with
from tests.storage.worlds.samples import town_cells, write_map, write_ros, write_scene

CELLS = town_cells(rows=200, columns=160)


@pytest.fixture
def town(tmp_path: Path) -> Path:
    write_map(tmp_path / "town.map", CELLS)
    return tmp_path / "town.map"


def test_a_map_becomes_a_file_of_problems_and_a_picture(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, picture = tmp_path / "town.parquet", tmp_path / "town.png"
    asked = ["import-worlds", str(town), "--out", str(out), "--problems", "4", "--picture", str(picture)]
    assert call(asked) == 0
    told = capsys.readouterr()
    assert "skipped" not in told.err
    assert str(out) in told.out.replace("\n", "")
    assert [line.split()[:4] for line in told.out.splitlines() if line.startswith(" town")] == [
        ["town", "train", "4", "0"],
        ["town", "test", "4", "0"],
    ]
    problems = read_problems(out)
    assert [problem.id for problem in problems[3:5]] == ["town-train-3", "town-test-0"]
    assert picture.stat().st_size > 10_000
    first = out.read_bytes()
    assert call(asked) == 0
    assert out.read_bytes() == first


def test_a_scale_is_kept_in_the_file(town: Path, tmp_path: Path) -> None:
    out = tmp_path / "small.jsonl"
    assert call(["import-worlds", str(town), "--out", str(out), "--problems", "3", "--scale", "0.5"]) == 0
    for problem in read_problems(out):
        assert problem.scale == 0.5
        assert problem.goal == (50.0, 50.0)
    assert '"goal": [25.0, 25.0]' in out.read_text()
    assert '"scale": 0.5' in out.read_text()


def test_a_folder_is_written_for_runs_and_written_again_but_never_over_something_else(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["import-worlds", str(town), "--problems", "3", "--out"]
    for _ in range(2):
        assert call([*asked, str(tmp_path / "worlds")]) == 0
    files = sorted(str(file.relative_to(tmp_path)) for file in (tmp_path / "worlds").rglob("*.*"))
    assert files == ["worlds/test/problems.parquet", "worlds/train/problems.parquet"]
    (tmp_path / "worlds" / "note.txt").write_text("mine")
    capsys.readouterr()
    assert call([*asked, str(tmp_path / "worlds")]) == 2
    assert "holds something else" in capsys.readouterr().err
    assert call([*asked, str(tmp_path)]) == 2
    assert "is the folder to import" in capsys.readouterr().err
    assert (tmp_path / "worlds" / "note.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "code", "told"),
    [
        (["--out", "p.csv"], 2, "p.csv is neither"),
        (["--out", "p.parquet", "--part", "most"], 2, "Unknown part 'most'"),
        (["--out", "p.parquet", "--format", "pdf"], 2, "Unknown format 'pdf'"),
        (["--out", "p.parquet", "--problems", "0"], 2, "0 problems"),
        (["--out", "p.parquet", "--seed", "-1"], 2, "Seed -1 is negative"),
        (["--out", "p.parquet", "--scale", "0"], 2, "Scale is 0"),
        (["--out", "p.parquet", "--tolerance", "-1"], 2, "Tolerance is -1"),
        (["--out", "p.parquet", "--unknown", "maybe"], 2, '"maybe"'),
        (["--out", "p.parquet", "--vehicle", "tram"], 2, "Unknown vehicle 'tram'"),
        (["--out", "p.parquet", "--picture", "p.bmp"], 2, "p.bmp is not the name of a picture"),
        (["--out", "p.parquet", "--part", "validation"], 1, "train and test"),
        (["--out", "p.parquet", "--resolution", "-1"], 1, "has resolution -1"),
        (["--out", "p.parquet", "--scale", "9"], 1, "too small to keep places to test on apart"),
        (["--out", "p.parquet", "--format", "ros"], 1, "is it the YAML of a map?"),
        (["--out", "p.json", "--problems", "2"], 1, "p.json can hold only one problem, got 4"),
    ],
)
def test_wrong_use_is_one_line_and_nothing_written(
    town: Path,
    tmp_path: Path,
    options: list[str],
    code: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(["import-worlds", str(town), *options]) == code
    printed = capsys.readouterr()
    assert told in printed.err
    assert printed.err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["town.map"]


def test_options_that_would_change_nothing_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "yard").mkdir()
    write_scene(tmp_path / "yard" / "0.txt", [box(20, 20).tolist()])
    write_ros(tmp_path / "town.yaml", CELLS)
    out = ["--out", str(tmp_path / "p.parquet")]
    for path, option in [
        ("yard", ["--scale", "2"]),
        ("yard", ["--tolerance", "1"]),
        ("yard", ["--seed", "2"]),
        ("yard", ["--resolution", "1"]),
        ("yard", ["--picture", "p.png"]),
        ("town.yaml", ["--resolution", "1"]),
    ]:
        assert call(["import-worlds", str(tmp_path / path), *out, *option]) == 2
        assert option[0] in capsys.readouterr().err


def test_two_parts_with_the_same_problem_do_not_become_one_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for part in ("train", "test"):
        write_problems(tmp_path / "mine" / part / "p.json", [problem_with([box(20, 20)])])
    assert call(["import-worlds", str(tmp_path / "mine"), "--out", str(tmp_path / "p.jsonl")]) == 1
    assert 'Both parts have a problem "p-1"' in capsys.readouterr().err
    assert call(["import-worlds", str(tmp_path / "mine"), "--out", str(tmp_path / "yours")]) == 0


def test_skipped_worlds_are_listed_and_under_strict_stop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "yard").mkdir()
    write_scene(tmp_path / "yard" / "0.txt", [box(20, 20).tolist()])
    write_scene(tmp_path / "yard" / "1.txt", [box(20, 20).tolist()])
    write_scene(tmp_path / "yard" / "2.txt", [box(0, 0).tolist()])
    out = tmp_path / "p.parquet"
    assert call(["import-worlds", str(tmp_path / "yard"), "--out", str(out)]) == 0
    told = capsys.readouterr().err
    assert told.startswith("1 skipped")
    assert "1 × cannot be planned in: start footprint" in told
    assert told.endswith("2.txt\n")
    out.unlink()
    assert call(["import-worlds", str(tmp_path / "yard"), "--out", str(out), "--strict"]) == 1
    assert "2.txt cannot be planned in" in capsys.readouterr().err
    assert not out.exists()


def test_a_car_other_than_the_one_that_cases_were_written_for_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = {"id": "a", "start": [0, 0, 0], "goal": [9, 0, 0], "obstacles": []}
    (tmp_path / "cases.json").write_text(json.dumps({"cases": [case]}))
    command = ["import-worlds", str(tmp_path / "cases.json"), "--format", "tpcap", "--part", "train", "--out"]
    assert call([*command, str(tmp_path / "a.jsonl")]) == 0
    assert "tpcap-car.yaml" in capsys.readouterr().err
    theirs = ["--vehicle", "docs/vehicles/benchmarks/tpcap-car.yaml"]
    assert call([*command, str(tmp_path / "b.jsonl"), *theirs]) == 0
    assert "tpcap-car.yaml" not in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["map", "folder"])
def test_a_run_collects_and_tests_on_a_map_or_on_what_was_cut_from_it(
    town: Path, tmp_path: Path, kind: str
) -> None:
    worlds = town
    if kind == "folder":
        worlds = tmp_path / "cut" / "town"
        assert call(["import-worlds", str(town), "--problems", "12", "--out", str(worlds)]) == 0
    settings = for_preset("smoke", worlds=[str(worlds)], experiences=3, candidates=6, test_problems=12)
    assert settings.class_names == ("town",)
    data = str(tmp_path / "data")
    (chunk,) = READ_WORLDS.chunks(data, settings)
    assert READ_WORLDS.do(chunk) == WorldsRead([])
    source = source_of(data, settings, "town")
    assert (source.count("collect", 99), source.count("test", 99)) == (12, 12)
    ids = {purpose: [source.problem(purpose, i).id for i in range(12)] for purpose in ("collect", "test")}  # type: ignore[arg-type]
    assert ids == {
        "collect": [f"town-train-{i}" for i in range(12)],
        "test": [f"town-test-{i}" for i in range(12)],
    }
    stored = read_imported(chunk.run.worlds("town", "train"))
    assert np.array_equal(stored[4].obstacles.vertices, source.problem("collect", 4).obstacles.vertices)
    assert all(problem.class_name == "town" for problem in stored)
    assert source_key(settings, "town") == source_key(settings, "town")


def test_importing_one_part_again_leaves_the_other(town: Path, tmp_path: Path) -> None:
    asked = ["import-worlds", str(town), "--problems", "3", "--out", str(tmp_path / "worlds")]
    assert call([*asked, "--part", "both"]) == 0
    before = (tmp_path / "worlds" / "test" / "problems.parquet").read_bytes()
    assert call([*asked, "--part", "train", "--seed", "2"]) == 0
    assert (tmp_path / "worlds" / "test" / "problems.parquet").read_bytes() == before


@pytest.mark.parametrize("name", ["ros", "moving-ai"])
def test_a_folder_is_no_map(tmp_path: Path, name: str) -> None:
    with pytest.raises(StorageError, match="name one map in it"):
        source_at(tmp_path, name)
