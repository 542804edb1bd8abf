"""Side by side: what a robot meets is what is timed, each problem once at a time."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from planners.attempt import Attempt
from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from tasks.attempts import side_by_side as module
from tasks.attempts.side_by_side import Contestant, side_by_side
from tasks.attempts.timing import DISPLACED_BYTES, OtherWork
from tasks.settings.run_settings import UNASSISTED

CONTESTANTS = [Contestant(planner, UNASSISTED, None, "run") for planner in ("rrt", "gust", "follow")]
DRAWN = problem_class("random")


class Seen:
    """Attempts and other work, in the order in which they were done."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.events: list[tuple[str, str] | None] = []  # None: other work
        monkeypatch.setattr(module, "solve", self.solve)
        monkeypatch.setattr(module, "OtherWork", lambda: lambda: self.events.append(None))

    def solve(self, problem: Problem, planner: str, *arguments: Any, **named: Any) -> Attempt:
        self.events.append((problem.id, planner))
        return solve(problem, planner, *arguments, **named)

    @property
    def timed(self) -> list[tuple[str, str]]:
        """The attempts since other work began."""
        return [event for event in self.events[self.events.index(None) :] if event is not None]


def rows_of(first: int, last: int) -> list[dict[str, Any]]:
    settings = SimpleNamespace(vehicle="car", seed=1)
    problems = [DRAWN.draw(7, index) for index in range(first, last)]
    return side_by_side(problems, cast(Any, settings), CONTESTANTS, {})


def test_no_problem_is_attempted_twice_in_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = Seen(monkeypatch)
    rows_of(2, 7)
    problems = [problem for problem, _ in seen.timed]
    for turn in np.reshape(problems, (len(CONTESTANTS), 5)):
        assert len(set(turn)) == 5  # all others lie between two attempts at a problem
        assert list(turn) == problems[:5]


def test_other_data_fill_the_caches_before_each_attempt(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = Seen(monkeypatch)
    rows_of(0, 3)
    timed = seen.events[seen.events.index(None) :]
    assert timed[::2] == [None] * 9
    assert None not in timed[1::2]


def test_every_contestant_attempts_each_problem_once(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = Seen(monkeypatch)
    rows = rows_of(0, 4)
    asked = [(row["problem_id"], row["planner"]) for row in rows]
    ids = [DRAWN.draw(7, index).id for index in range(4)]
    assert asked == [(identity, each.planner) for identity in ids for each in CONTESTANTS]
    assert sorted(asked) == sorted(seen.timed)


def test_other_work_writes_to_more_than_a_core_keeps() -> None:
    work = OtherWork()
    work()
    (data,) = vars(work).values()
    assert data.nbytes == DISPLACED_BYTES
    assert (data == 1.0).all()
