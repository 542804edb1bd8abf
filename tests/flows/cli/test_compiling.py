"""Who waits for kernels to be compiled is told why, once, on the error stream alone."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from flows.cli.document import Document
from flows.cli.terminal import notices_shown, telling, write_document
from planners.world import compiling, kernel_files

KERNELS = """
from planners.world.jit import jit

@jit
def twice(x):
    return 2.0 * x

@jit
def four_times(x):
    return twice(twice(x))
"""
Told = Callable[..., tuple[str, str]]


@pytest.fixture
def told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Told:
    """Says what is written to the output and the error stream while kernels are compiled."""
    (tmp_path / "kernels.py").write_text(KERNELS)
    monkeypatch.setattr(kernel_files, "CACHE", tmp_path)

    def told(after_s: float, how: str = "", every_s: float = 1e9) -> tuple[str, str]:
        monkeypatch.setattr(compiling, "TOLD_AFTER", after_s)
        monkeypatch.setattr(compiling, "TOLD_EVERY", every_s)
        for listener in compiling._told:  # as in a process that has compiled nothing
            monkeypatch.setattr(listener, "_done_s", 0.0)
            monkeypatch.setattr(listener, "_lines", 0)
        four_times = _new_kernel(tmp_path / "kernels.py", monkeypatch)
        if how == "no command":
            assert four_times(1.0) == 4.0
        else:
            with notices_shown():
                telling().quiet = how == "quiet"
                telling().document = Document() if how == "json" else None
                assert four_times(1.0) == 4.0
                assert four_times(1) == 4.0
                write_document(0)
        return capsys.readouterr()

    return told


def _new_kernel(file: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A kernel that calls another one, as in a new process: what was compiled is on disk only."""
    found = spec_from_file_location("kernels_of_a_test", file)
    assert found is not None
    assert found.loader is not None
    module = module_from_spec(found)
    monkeypatch.setitem(sys.modules, found.name, module)
    found.loader.exec_module(module)
    return module.four_times


def test_a_command_says_once_that_it_compiles_and_only_then(told: Told) -> None:
    out, first = told(0.0)
    assert out == ""
    assert first.startswith("Compiling")
    assert first.count("\n") == 1
    assert told(0.0) == ("", "")  # kernels are kept on disk


def test_who_waits_longer_is_told_again_and_again_for_how_long(told: Told) -> None:
    first, *others = told(0.0, every_s=1e-6)[1].splitlines()
    assert first.startswith("Compiling")
    assert others
    assert all(re.fullmatch(r"Still compiling, after \d+ s\.", line) for line in others)


@pytest.mark.parametrize("how", ["quiet", "no command", "soon"])
def test_nothing_is_told_to_who_wants_quiet_or_runs_no_command_or_waits_for_a_moment(
    told: Told, how: str
) -> None:
    assert told(1e9 if how == "soon" else 0.0, how) == ("", "")


def test_the_document_of_a_command_does_not_change(told: Told) -> None:
    out, while_compiling = told(0.0, "json")
    assert while_compiling
    assert told(1e9, "json") == (out, "")
