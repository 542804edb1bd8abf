"""``gather``: a library of judged plans, the same for any number of workers, or one line says why not."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.cli.main import call
from storage.archives.libraries import load_library
from storage.exchange.problems import write_problems
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
    assert call([*asked, "--plans", "3"]) == 1
    told = capsys.readouterr().err
    assert "2 of the 3 questions" in told
    assert "3 plans" in told
    assert not (tmp_path / "library").exists()
    assert call([*asked, "--plans", "2"]) == 0
    assert load_library(tmp_path / "library").questions == ("strewn-1-10", "strewn-2-10")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--plans", "0"], "0 plans: give 1 or more."),
        (["--poses", "1.5"], "A share of 1.5 poses: give 0 to 1."),
    ],
)
def test_wrong_use_is_told_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], line: str
) -> None:
    assert call(["gather", "random", "--out", str(tmp_path / "library"), *options]) == 2
    assert line in capsys.readouterr().err
