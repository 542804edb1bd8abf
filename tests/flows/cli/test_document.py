"""With ``--json`` a command writes one document, and in it the rows of the tables that it would print."""

from __future__ import annotations

import json
import logging
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.cells import NOTHING, Cell, CellTable, count, decimal, value_of, with_interval
from flows.cli import terminal
from flows.cli.document import Document
from flows.cli.main import call
from flows.cli.terminal import notices_shown, telling, write

TABLE = CellTable(
    "Times",
    ("planner", "ms", "reduction % [95 %]", "checks"),
    [
        [
            ["1", decimal(1234.5678, 1), NOTHING, count(47312.0)],
            [
                "gust",
                "1,200",
                with_interval(0.375, 0.25, float("nan")),
                Cell("12→9", first=12, other=np.int64(9)),
            ],
        ]
    ],
)
ROWS = [
    {"planner": "1", "ms": 1234.5678, "reduction % [95 %]": None, "checks": 47312.0},
    {
        "planner": "gust",
        "ms": 1200,
        "reduction % [95 %]": {"value": 37.5, "low": 25.0, "high": None},
        "checks": {"first": 12, "other": 9},
    },
]


def test_a_document_has_the_rows_of_the_table_as_values() -> None:
    document = Document()
    document.add(TABLE)
    assert document.tables == [{"name": "", "title": "Times", "rows": ROWS}]


@given(st.floats(0.0, 1e12), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), st.integers(0, 2))
def test_what_cells_say_is_not_rounded(value: float, share: list[float], decimals: int) -> None:
    read = json.loads(json.dumps([value_of(count(value)), value_of(with_interval(*share, decimals))]))
    assert read[0] == value
    assert list(read[1].values()) == [100.0 * each for each in share]
    cell = pickle.loads(pickle.dumps(with_interval(*share, decimals)))  # as other processes get it
    assert value_of(cell) == read[1]


def _told(capsys: pytest.CaptureFixture[str], **options: Any) -> tuple[str, str]:
    """What a command writes to the output and to the error stream that tells a bit of everything."""
    with notices_shown():
        for name, value in options.items():
            setattr(telling(), name, value)
        logging.getLogger("tasks.reports.report").info(TABLE)
        logging.getLogger("tasks.requests.x").info("found %d", 7)
        logging.getLogger(terminal.DETAILS[0]).info("3 chunks")
        logging.getLogger("storage.x").warning("mind this")
        write("done")
        terminal.write_files(rows=Path("rows.parquet"), plans=None)
        terminal.write_document(0)
    printed = capsys.readouterr()
    return printed.out, printed.err


def test_the_output_is_one_document_and_notices_stay_on_the_error_stream(
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, err = _told(capsys, document=Document())
    assert json.loads(out) == {
        "exit_code": 0,
        "answer": None,
        "tables": [{"name": "", "title": "Times", "rows": ROWS}],
        "lines": ["found 7", "done"],
        "files": {"rows": "rows.parquet"},
        "warnings": ["mind this"],
        "error": None,
    }
    assert err == "found 7\nmind this\n"


def test_quiet_leaves_results_and_warnings_and_verbose_adds_the_work(
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, warnings = _told(capsys, quiet=True)
    assert out.endswith("done\nrows     rows.parquet\n")
    assert "planner" in out  # the table of a report
    assert "found 7" not in out
    assert warnings == "mind this\n"
    verbose, plain = (_told(capsys, verbose=each)[0].splitlines() for each in (True, False))
    assert [line for line in verbose if line not in plain] == ["3 chunks"]
    assert "found 7" in plain


@pytest.mark.parametrize(
    ("arguments", "code"), [(["verify", "nowhere", "--json"], 1), (["--json", "verify", "a", "--x"], 2)]
)
def test_a_failure_is_a_document_too(
    arguments: list[str], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(arguments) == code
    printed = capsys.readouterr()
    told = json.loads(printed.out)
    assert told["exit_code"] == code
    assert printed.err == f"motion-memory: {told['error']}\n"


def test_a_command_gives_its_table_as_a_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "town.npy", np.zeros((160, 160), np.uint8))
    asked = ["import-worlds", str(tmp_path / "town.npy"), "--problems", "2", "--json"]
    assert call([*asked, "--out", str(tmp_path / "problems.jsonl")]) == 0
    told = json.loads(capsys.readouterr().out)
    (table,) = told["tables"]
    assert [row["problems"] for row in table["rows"]] == [2, 2]
    assert told["files"] == {"problems": str(tmp_path / "problems.jsonl")}
