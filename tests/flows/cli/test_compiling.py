"""Who waits for kernels to be compiled is told why, once, on the error stream alone."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

KERNELS = """
import sys
from planners.world import compiling, jit
from flows.cli.document import Document
from flows.cli.terminal import notices_shown, telling, write_document

@jit.jit
def twice(x):
    return 2.0 * x

@jit.jit
def four_times(x):
    return twice(twice(x))

compiling.TOLD_AFTER = float(sys.argv[1])
compiling.TOLD_EVERY = float(sys.argv[3])
if sys.argv[2] == "no command":
    sys.exit(four_times(1.0) != 4.0)
with notices_shown():
    telling().quiet = sys.argv[2] == "quiet"
    telling().document = Document() if sys.argv[2] == "json" else None
    assert four_times(1.0) == 4.0
    assert four_times(1) == 4.0
    write_document(0)
"""


def _told(folder: Path, after_s: float, how: str, every_s: float = 1e9) -> tuple[str, str]:
    """What is written to the output and the error stream while kernels are compiled."""
    (folder / "kernels.py").write_text(KERNELS)
    root = Path(__file__).parents[3]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, str(folder / "kernels.py"), str(after_s), how, str(every_s)],
        capture_output=True, text=True, check=True, env=environment,
    )  # fmt: skip
    return done.stdout, done.stderr


def test_a_command_says_once_that_it_compiles_and_only_then(tmp_path: Path) -> None:
    out, told = _told(tmp_path, 0.0, "")
    assert out == ""
    assert told.startswith("Compiling")
    assert told.count("\n") == 1
    assert _told(tmp_path, 0.0, "") == ("", "")  # kernels are kept on disk


def test_who_waits_longer_is_told_again_and_again_for_how_long(tmp_path: Path) -> None:
    _, told = _told(tmp_path, 0.0, "", every_s=1e-6)
    first, *others = told.splitlines()
    assert first.startswith("Compiling")
    assert others
    assert all(re.fullmatch(r"Still compiling, after \d+ s\.", line) for line in others)


@pytest.mark.parametrize("how", ["quiet", "no command", "soon"])
def test_nothing_is_told_to_who_wants_quiet_or_runs_no_command_or_waits_for_a_moment(
    tmp_path: Path, how: str
) -> None:
    assert _told(tmp_path, 1e9 if how == "soon" else 0.0, how) == ("", "")


def test_the_document_of_a_command_does_not_change(tmp_path: Path) -> None:
    out, told = _told(tmp_path, 0.0, "json")
    assert told
    assert _told(tmp_path, 1e9, "json") == (out, "")
