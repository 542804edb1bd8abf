"""The configuration file gives the options of commands; what it cannot give is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.cli.configuration import FILE
from flows.cli.main import call


def _called(folder: Path, text: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    (folder / FILE).write_text(text)
    below = folder / "below"
    below.mkdir(exist_ok=True)
    monkeypatch.chdir(below)
    return call(arguments)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[verify]\nsample = 2.0", "--sample is 2.0"),
        ("[verify]\nsampel = 0.5", "--sample"),
        ("[verify]\nsample = 'x'", "sample"),
        ("[verify]\nmap = ''", "empty"),
        ("[veryfi]\nsample = 0.5", "[verify]"),
        ("sample = 0.5", "'sample', which is not a command"),
        ("verify = 0.5", "[verify]"),
        ("[verify", "is not TOML"),
    ],
)
def test_what_is_wrong_in_the_file_is_told_in_one_line(
    text: str,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert _called(tmp_path, text, ["verify", "nowhere"], monkeypatch) == 2
    printed = capsys.readouterr().err
    assert told in printed
    assert printed.count("\n") == 1


def test_the_command_line_comes_before_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["verify", "nowhere", "--sample", "0.5"]
    assert _called(tmp_path, "[verify]\nsample = 2.0", arguments, monkeypatch) == 1
    assert "nowhere does not exist" in capsys.readouterr().err


def test_a_command_without_a_table_is_as_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _called(tmp_path, "[run]\nseed = 3", ["verify", "nowhere"], monkeypatch) == 1
    assert "nowhere does not exist" in capsys.readouterr().err
