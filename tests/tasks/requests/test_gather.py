"""``gather``: a library of judged plans, the same for any number of workers, or one line says why not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from flows.cli.main import call
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.vehicles.vehicle import CAR, VEHICLES
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.errors import InUseError, StorageError
from storage.exchange.problems import write_problems
from storage.worlds.importing import ImportSettings
from tasks.inputs.gained_on_the_job import Solved, remember
from tasks.requests import gather, part_folder
from tasks.requests import gather_pieces as pieces
from tasks.requests.question_sources import question_source
from tasks.settings.errors import RunError, UsageError
from tests.storage.worlds.samples import town_cells, write_map
from tests.worlds import strewn, walled_goal


def test_questions_of_all_sources_are_answered_in_turn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_map(tmp_path / "town.map", town_cells(rows=200, columns=160))
    asked = ["gather", "random", str(tmp_path / "town.map"), "--plans", "6", "--poses", "0.34"]
    assert call([*asked, "--out", str(tmp_path / "one"), "--workers", "1"]) == 0
    assert "library" in capsys.readouterr().out
    library = load_library(tmp_path / "one")
    assert len(library) == 6
    assert library.class_name == "general"
    assert sum("town" in question for question in library.questions) >= 2
    assert call([*asked, "--out", str(tmp_path / "two"), "--workers", "2"]) == 0
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes()


def test_the_questions_of_a_file_are_asked_as_they_stand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problems = tmp_path / "asked.jsonl"
    write_problems(problems, [strewn(1, 10), walled_goal(), strewn(2, 10)])
    asked = ["gather", str(problems), "--out", str(tmp_path / "library"), "--workers", "1"]
    assert call([*asked, "--plans", "2"]) == 0
    library = load_library(tmp_path / "library")
    assert library.questions == ("strewn-1-10", "strewn-2-10")
    capsys.readouterr()
    first = {file.name: file.read_bytes() for file in (tmp_path / "library").iterdir()}
    assert call([*asked, "--plans", "3"]) == 2  # the library is kept
    assert {file.name: file.read_bytes() for file in (tmp_path / "library").iterdir()} == first
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "--out" in told
    shutil.rmtree(tmp_path / "library")
    assert call([*asked, "--plans", "3"]) == 3  # there are no more
    told = capsys.readouterr().err
    assert "2 of 3" in told
    assert "3 plans" in told
    assert load_library(tmp_path / "library").questions == ("strewn-1-10", "strewn-2-10")


def test_what_is_stored_for_a_pose_is_quicker_than_what_is_answered_at_once(tmp_path: Path) -> None:
    drawn = family("perpendicular", "hard")
    asked = [drawn.draw(11, number) for number in (15, 16)]
    answers = [solve(to_canonical(problem)[0], "lattice", seed=1).plan for problem in asked]
    write_problems(tmp_path / "slots.jsonl", asked)
    gather.gather([str(tmp_path / "slots.jsonl")], tmp_path / "library", 2, 1.0, "standard", ImportSettings())
    library = load_library(tmp_path / "library")
    stored = [
        min(
            plan.duration_s
            for plan, of in zip(library.plans, library.questions, strict=True)
            if of == each.id
        )
        for each in asked
    ]
    at_once = [plan.duration_s for plan in answers if plan is not None]
    assert len(at_once) == len(asked)
    assert sum(stored) < sum(at_once)
    assert all(kept < soon + 0.15 for kept, soon in zip(stored, at_once, strict=True))


def test_what_was_learned_at_work_is_gathered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = [family("perpendicular").draw(11, number) for number in (15, 16)]
    write_problems(Path("today.jsonl"), asked)
    gathering = [
        "gather",
        "data",
        "--plans",
        "2",
        "--workers",
        "1",
        "--out",
        "data/libraries/slots",
        "--json",
    ]
    solving = ["solve", "today.jsonl", "--planner", "lattice", "--learn", "data", "--plans", "plans"]
    assert call([*solving, "--out", "first.parquet", "--workers", "1"]) == 0
    driven = [json.loads(file.read_text())["duration_s"] for file in sorted(Path("plans").iterdir())]
    capsys.readouterr()
    assert call([*gathering[:-2], "elsewhere", "--vehicle", "car-1-trailer"]) == 1  # others learned nothing
    assert capsys.readouterr().err.count("\n") == 1
    assert call(gathering) == 0
    (table,) = json.loads(capsys.readouterr().out)["tables"]
    assert table["rows"][0]["answered"] == len(asked)
    assert table["rows"][0]["driving_s"] <= sum(driven) / len(driven) + 1e-9  # never worse than at work
    library = load_library(Path("data/libraries/slots"))
    again = ["--memory", "data/libraries/slots", "--assist", "repair", "--out", "second.parquet", "--json"]
    assert call([*solving[:-2], *again, "--workers", "1"]) == 0
    answer = json.loads(capsys.readouterr().out)["answer"]
    assert answer["outcomes"] == {"repaired": len(asked)}  # by their own drives, which are nothing new
    assert call(gathering) == 0
    assert load_library(Path("data/libraries/slots")).questions == library.questions
    assert call(["verify", "data"]) == 0


@pytest.mark.parametrize("end", [RunError, KeyboardInterrupt, InUseError])
def test_gathering_that_failed_sees_what_was_learned_since_and_a_killed_one_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: type[BaseException]
) -> None:
    def learn(number: int) -> None:
        question = to_canonical(family("perpendicular").draw(11, number))[0]
        remember(tmp_path / "data", [Solved(question, solve(question, "lattice", seed=1))], CAR)

    def gathered() -> int:
        sources = [str(tmp_path / "data")]
        counts = gather.gather(sources, tmp_path / "slots", None, 0.0, "standard", ImportSettings())
        return sum(each.answered for each in counts)

    def stop(*_: object) -> None:
        raise end

    learn(15)
    with monkeypatch.context() as stopped:
        stopped.setattr(gather, "library_of", stop)
        with pytest.raises(end):
            gathered()
    learn(16)
    assert gathered() == (2 if end is RunError else 1)  # another command may use what was taken
    assert not list((tmp_path / "data").rglob("snapshots/*.parquet"))


def test_a_question_that_the_search_does_not_answer_keeps_the_plan_that_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    question = to_canonical(family("perpendicular").draw(11, 15))[0]
    attempt = solve(question, "lattice", seed=1)
    assert attempt.plan is not None
    monkeypatch.setattr(pieces, "solve", lambda *_, **__: replace(attempt, plan=None))
    stored = pieces.stored_variants(question, CAR, 1, Workspace(), attempt.plan)
    assert stored == [attempt.plan]
    assert pieces.stored_variants(question, CAR, 1, Workspace()) == []


def test_the_table_counts_the_questions_and_the_plans_of_each_source(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "library"
    asked = ["gather", "lot", "random", "--plans", "6", "--workers", "1", "--out", str(out), "--json"]
    assert call(asked) == 0
    (table,) = json.loads(capsys.readouterr().out)["tables"]
    library = load_library(out)
    of = [["lot" if each.startswith("lot") else "random", each] for each in library.questions]
    for row in table["rows"]:
        own = [question for source, question in of if source == row["source"]]
        assert row["plans"] == len(own)
        assert row["answered"] == len(set(own)) <= row["questions"]
    assert len(library) == sum(row["plans"] for row in table["rows"]) > 6


def test_a_repeated_command_does_nothing_and_tells_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_problems(Path("asked.jsonl"), [strewn(1, 10), walled_goal(), strewn(2, 10)])
    for plans, code in (("2", 0), ("3", 3)):  # of which one cannot be answered
        asked = ["gather", "asked.jsonl", "--plans", plans, "--out", f"library-{plans}", "--json"]
        told = []
        for workers in ("1", "2"):
            with monkeypatch.context() as patch:
                if workers == "2":
                    patch.setattr(gather, "gather_pieces", None)  # nothing is done
                assert call([*asked, "--workers", workers]) == code
            told.append(json.loads(capsys.readouterr().out))
        assert told[0]["tables"] == told[1]["tables"]
        assert told[0]["files"] == told[1]["files"]
        assert told[0]["warnings"] == told[1]["warnings"]
        assert told[1]["lines"] != []
    for change in (["--seed", "2"], ["--plans", "1"], ["--poses", "0.5"], ["--vehicle", "car-1-trailer"]):
        assert call([*asked, *change]) == 2
    (Path("library-3") / "controls.npy").unlink()
    assert call(asked) == 1  # a damaged library is not said to be there
    write_problems(Path("asked.jsonl"), [strewn(1, 10)])
    assert call(asked) == 2


def test_gathering_that_was_interrupted_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "PIECE", 4)
    monkeypatch.setattr(gather, "FEW_PLANS", 0)
    monkeypatch.setattr(gather, "part_workers", lambda *_: nullcontext())  # they would have nothing to do
    done: list[int] = []

    def backwards(some: Sequence[pieces.GatherPiece]) -> list[pieces.Gathered]:
        left = [piece for piece in some if pieces.GATHER.kept(piece) is None]
        for piece in left[::-1]:
            pieces.GATHER.run(piece)
            done.append(piece.index)
            if len(done) == 2:
                raise KeyboardInterrupt
        kept = [pieces.GATHER.kept(piece) for piece in some]
        return [each.result for each in kept if each is not None]

    def gathered(name: str, workers: int) -> None:
        out = tmp_path / name
        flow = partial(pieces.gather_pieces, do=backwards)
        gather.gather(["random"], out, 14, 0.5, "easy", ImportSettings(), workers, flow)

    with pytest.raises(KeyboardInterrupt):
        gathered("interrupted", workers=2)
    damaged = done[0]  # in the middle of its rows, and then what is kept beside it
    (shard,) = (tmp_path / "interrupted.parts").glob(f"{damaged:06d}.parquet")
    shard.write_bytes(shard.read_bytes()[:200] + bytes(60) + shard.read_bytes()[260:])
    (result,) = (tmp_path / "interrupted.parts").glob(f"{done[1]:06d}-*.json")
    result.write_text("[1]")
    gathered("interrupted", workers=2)
    assert sorted(done) == sorted([*set(done), *done[:2]])
    gathered("whole", workers=1)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["interrupted", "whole"]
    for file in (tmp_path / "whole").iterdir():
        assert file.read_bytes() == (tmp_path / "interrupted" / file.name).read_bytes()


@pytest.mark.parametrize("name", ["thesis", "thesis/library", "problems.jsonl", "."])
def test_nothing_that_is_there_is_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "library.parts").mkdir()
    (tmp_path / "thesis" / "library.parts" / "page.tex").write_text("words")
    write_problems(tmp_path / "problems.jsonl", [strewn(1, 10)])
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.chdir(tmp_path)
    assert call(["gather", "problems.jsonl", "--plans", "1", "--workers", "1", "--out", name]) in (1, 2)
    assert capsys.readouterr().err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_who_waits_for_workers_is_told_before_they_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []

    def server(_: Path) -> None:
        told.append(capsys.readouterr().out)
        raise RunError("no server today")

    monkeypatch.setattr(part_folder, "local_server", server)
    asked = ["gather", "random", "--plans", "60", "--workers", "2", "--out", str(tmp_path / "library")]
    assert call(asked) == call([*asked, "--quiet"]) == 1
    assert "worker" in told[0]
    assert told[0].count("\n") == 1
    assert told[1] == ""


def test_sources_that_have_changed_are_read_again_in_the_same_process(tmp_path: Path) -> None:
    problems = tmp_path / "asked.jsonl"
    for seed in (1, 2):
        out = tmp_path / f"library-{seed}"
        write_problems(problems, [strewn(seed, 10)])
        gather.gather([str(problems)], out, 1, 0.0, "standard", ImportSettings())
        assert load_library(out).questions == (f"strewn-{seed}-10",)


def test_a_source_that_cannot_be_asked_is_told_before_workers_start(tmp_path: Path) -> None:
    def flow(_: object) -> list[pieces.Gathered]:
        raise AssertionError

    write_problems(tmp_path / "trailer.jsonl", [strewn(1, 10)], VEHICLES["car-1-trailer"])
    for source, error in (("dock", UsageError), (str(tmp_path / "trailer.jsonl"), StorageError)):
        with pytest.raises(error):
            gather.gather([source], tmp_path / "library", 60, 0.0, "standard", ImportSettings(), 2, flow)
        assert list(tmp_path.iterdir()) == [tmp_path / "trailer.jsonl"]


def test_without_any_answer_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_problems(tmp_path / "asked.jsonl", [walled_goal()])
    out = tmp_path / "library"
    assert call(["gather", str(tmp_path / "asked.jsonl"), "--out", str(out), "--plans", "1"]) == 1
    assert "None of the 1 questions" in capsys.readouterr().err
    assert not out.exists()


def test_the_difficulty_of_drawn_questions_can_be_chosen(tmp_path: Path) -> None:
    settings = ImportSettings()
    for name in ("random", "parallel"):
        easy, hard = (question_source(name, 1, 0.0, each, settings).draw(0) for each in ("easy", "hard"))
        assert easy is not None
        assert hard is not None
        assert easy.obstacles.vertices.tolist() != hard.obstacles.vertices.tolist()


def test_a_difficulty_that_no_source_has_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_problems(tmp_path / "asked.jsonl", [strewn(1, 10)])
    asked = ["gather", str(tmp_path / "asked.jsonl"), "--out", str(tmp_path / "library")]
    assert call([*asked, "--difficulty", "hard"]) == 2
    assert "--difficulty" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--difficulty", "odd"], "odd"),
        (["--plans", "0"], "0 plans: give 1 or more."),
        (["--poses", "1.5"], "--poses is 1.5"),
    ],
)
def test_wrong_use_is_told_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], line: str
) -> None:
    assert call(["gather", "random", "--out", str(tmp_path / "library"), *options]) == 2
    assert line in capsys.readouterr().err


def test_a_name_is_a_family_and_a_path_is_a_folder_whatever_folders_there_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pieces, "PIECE", 1)
    asked = ["gather", "lot", "--plans", "1", "--poses", "1", "--workers", "1", "--out"]
    assert call([*asked, "before"]) == 0
    assert capsys.readouterr().err.count("./lot") == 0
    Path("lot").mkdir()
    write_problems(Path("lot") / "own.jsonl", [strewn(1, 10)])
    assert call([*asked, "after"]) == 0
    assert capsys.readouterr().err.count("./lot") == 1
    assert call(["gather", "./lot", *asked[2:], "folder"]) == 0
    assert "./lot" not in capsys.readouterr().err
    before, after, folder = (load_library(Path(name)).questions for name in ("before", "after", "folder"))
    assert before == after != folder


def test_a_library_may_be_called_like_the_family_it_was_gathered_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pieces, "PIECE", 1)
    for _ in range(2):
        assert call(["gather", "lot", "--plans", "1", "--workers", "1", "--out", "lot"]) == 0


def test_a_misspelt_family_is_told_with_the_nearest_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["gather", "perpendiculr", "--out", str(tmp_path / "library")]) == 1
    assert "nearest is 'perpendicular'" in capsys.readouterr().err


def test_no_more_is_asked_than_files_hold(tmp_path: Path) -> None:
    problems = tmp_path / "asked.jsonl"
    write_problems(problems, [strewn(number, 10) for number in range(3)])
    sources = (str(problems), str(problems))
    request = pieces.GatherRequest(sources, tmp_path, 1000, 0.0, "standard", ImportSettings())
    done: list[int] = []

    def do(given: Sequence[pieces.GatherPiece]) -> list[pieces.Gathered]:
        done.extend(each.index for each in given)
        return [pieces.Gathered([], []) for _ in given]

    pieces.gather_pieces(request, do)
    assert done == [0]  # of six numbers


def test_where_there_is_no_room_for_any_question_gathering_ends(tmp_path: Path) -> None:
    request = pieces.GatherRequest(("random",), tmp_path, 3, 0.0, "standard", ImportSettings())
    done = pieces.gather_pieces(request, lambda given: [pieces.Gathered([], []) for _ in given])
    assert len(done) * pieces.PIECE >= pieces.GIVE_UP * request.plans


def test_sources_of_one_name_are_counted_together_in_a_form_that_mlflow_takes() -> None:
    counts = [
        gather.SourceCounts(name, 5, 4, plans, 9.0) for name, plans in (("a(1).map", 3), ("a(1).map", 4))
    ]
    assert gather.gathered_metrics(counts)["plans_a_1_.map"] == 7.0


@pytest.mark.parametrize(
    ("plans", "sources", "wanted"),
    [
        (None, ["asked.jsonl"], 10),
        (7, ["asked.jsonl"], 7),
        (None, ["asked.jsonl", "lot"], 1_000),
        (None, ["town.map"], 1_000),
    ],
)
def test_all_that_files_hold_is_enough_if_no_number_is_given(
    plans: int | None, sources: list[str], wanted: int
) -> None:
    counts = [gather.SourceCounts("asked", 10, 9, 16, 9.0)]
    assert gather.wanted_plans(plans, sources, counts) == wanted
