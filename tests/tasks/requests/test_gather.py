"""``gather``: a library of judged plans, the same for any number of workers, or one line says why not."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest

from flows.cli.main import call
from storage.archives.libraries import load_library
from storage.exchange.problems import write_problems
from storage.worlds.importing import ImportSettings
from tasks.requests import gather
from tasks.requests import gather_pieces as pieces
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


def test_gathering_that_was_interrupted_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "PIECE", 4)
    monkeypatch.setattr(gather, "FEW_PLANS", 0)
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
        gather.gather(["random"], out, 14, 0.5, ImportSettings(), workers, flow)

    with pytest.raises(KeyboardInterrupt):
        gathered("interrupted", workers=2)
    gathered("interrupted", workers=2)
    assert len(done) == len(set(done))
    gathered("whole", workers=1)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["interrupted", "whole"]
    for file in (tmp_path / "whole").iterdir():
        assert file.read_bytes() == (tmp_path / "interrupted" / file.name).read_bytes()


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
