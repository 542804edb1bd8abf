"""Help at once, where a memory's help would wait until the planner's own search has cost so much."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock


@contextmanager
def early_help() -> Iterator[None]:
    """Inside, a memory helps after a single expansion of the planner's own search."""
    with (
        mock.patch("planners.search.help.PATIENCE", 0),
        mock.patch("planners.memory_answers.PATIENCE", 0),
        mock.patch("planners.search.search_loop.SLICE", 1),
    ):
        yield
