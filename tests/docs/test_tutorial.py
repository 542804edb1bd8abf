"""The tutorial says what happens."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.tutorial import as_anywhere, begin, do, is_shown, picture_in, pictures, smaller, steps
from tests.prepared.prefect_database import with_prefect_database
from tests.worlds import SHARED

needs_worlds = pytest.mark.skipif(not SHARED.is_dir(), reason="the real worlds are not here")


@pytest.mark.slow
@pytest.mark.timeout(600)
@needs_worlds
def test_the_commands_work_in_their_order_and_leave_the_pictures(tmp_path: Path) -> None:
    """With fewer problems than the tutorial's."""
    begin(tmp_path)
    with_prefect_database(tmp_path / "data")
    for step in steps():
        printed = do(smaller(step), tmp_path)
        assert bool(printed) == bool(step.shown), f"{step.commands}\n{printed}"
    for name in pictures():
        assert picture_in(tmp_path, name).stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.timeout(1200)
@needs_worlds
def test_each_command_prints_what_the_tutorial_shows(tmp_path: Path) -> None:
    begin(tmp_path)
    for step in steps():
        printed = do(step, tmp_path)
        assert is_shown(as_anywhere(step.shown), as_anywhere(printed)), f"{step.commands}\n{printed}"


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("a 1.5 b", "a   12.25   b", True),
        ("a 15 b", "a 16 b", False),
        ("40 problems/s: 500", "77 problems/s: 500", True),
        ("a\n…\nc", "a\nb\nb\nc", True),
        ("a\n…\nc", "a\nb\nb", False),
        ("a\n…", "a", True),
        ("a", "a\nb", False),
        ("", "", True),
    ],
)
def test_times_may_differ_and_dots_stand_for_lines(shown: str, printed: str, same: bool) -> None:
    assert is_shown(as_anywhere(shown), as_anywhere(printed)) == same
