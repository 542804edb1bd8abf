from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.vehicles.vehicle import CAR
from storage.places.run_folder import RunFolder
from storage.tables.attempts import write_attempts
from tasks.attempts.attempt_rows import attempt_row
from tests.trials.row_digests import digests

ATTEMPT = solve(problem_class("curves", "easy").draw(5, 0), "follow")


def _digests(folder: Path, **changes: object) -> dict[str, str]:
    row = attempt_row(replace(ATTEMPT, **changes), None, None, CAR)
    write_attempts(RunFolder(folder).shard("results", "curves", 0), [row])
    return digests(RunFolder(folder))


def test_a_digest_says_nothing_of_times_and_all_of_the_rest(tmp_path: Path) -> None:
    one = _digests(tmp_path / "one")
    assert one == _digests(tmp_path / "other", planning_seconds=ATTEMPT.planning_seconds + 1.0)
    assert one != _digests(tmp_path / "third", nodes=ATTEMPT.nodes + 1)
