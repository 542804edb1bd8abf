"""Retraining: laws that a whole story of it keeps (``retraining_story``), told once for all processes."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from storage.places.data_folder import open_data_folder
from storage.tables.experiences import read_experiences
from tasks.attempts import side_by_side
from tasks.champions import conclude as task
from tasks.champions.dry_run import dry_run
from tasks.fan_out.chunk import run_folder
from tasks.inputs.problem_sources import held_back, source_of
from tasks.registry.champion_registry import AWAITING, FIRST, PROMOTED, REFUSED, ROLLED_BACK
from tasks.reports import report
from tasks.settings.run_settings import RunSettings
from tasks.stages import build_memory, hallucinate
from tasks.stages.judge import judged
from tasks.tracking import mlflow_runs
from tests.prepared.mlflow_database import LOUD_LIBRARIES, with_mlflow_database
from tests.tasks.champions.retrained import CLASS, SETTINGS, timed_by_work
from tests.tasks.champions.retraining_story import Story

pytestmark = [pytest.mark.timeout(600), LOUD_LIBRARIES]


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Iterator[Story]:
    """The story, and what was seen in it."""
    shared = tmp_path_factory.getbasetemp()
    shared = shared if worker_id == "master" else shared.parent
    told, seen = Story(str(shared / "retraining")), shared / "retraining.json"
    with (shared / "retraining.lock").open("w") as lock, pytest.MonkeyPatch.context() as patch:
        fcntl.flock(lock, fcntl.LOCK_EX)
        patch.setenv("MOTION_MEMORY_DATA", told.data)
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        patch.delenv("PREFECT_API_URL", raising=False)
        if not seen.exists():
            patch.setattr(task, "publish_judgements", lambda *_: None)  # no Prefect to tell
            patch.setattr(hallucinate, "CHUNK_PROBLEMS", 80)  # two plans a chunk
            patch.setattr(side_by_side, "solve", timed_by_work)
            patch.setattr(build_memory, "_draw", lambda *_: None)  # seconds of pictures
            patch.setattr(report, "save", lambda *_: None)
            with_mlflow_database(Path(told.data))
            told.tell(patch)
            seen.write_text(json.dumps(told.seen))
        told.seen = json.loads(seen.read_text())
        fcntl.flock(lock, fcntl.LOCK_UN)
        yield told
    mlflow_runs.tracker.cache_clear()


def _last(state: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = state["versions"][-1]
    return found


def test_the_first_run_makes_the_first_champion_and_a_better_challenger_the_next(story: Story) -> None:
    state = story.seen["promoted"]
    one, two = state["versions"]
    assert (one["verdict"], one["learned"], one["retraining"]) == (FIRST, "", "0")
    assert (two["verdict"], two["against"], two["previous"]) == (PROMOTED, "1", "1")
    assert state["champion"] == 2
    assert float(two["low_s"]) > 0.0
    assert two["learned"].startswith("retrain-0001-")
    assert json.loads(two["benchmark"])["gust closed 5 exhaustive"]["problems"] == SETTINGS.test_problems
    assert RunSettings.from_json(story.seen["second"]).epochs == SETTINGS.epochs // 2
    assert story.seen["registered as made"]


def test_champion_and_challenger_attempt_the_same_problems_that_nobody_else_has_seen(story: Story) -> None:
    first, second = (RunSettings.from_json(story.seen[name]) for name in ("first", "second"))
    champion, challenger = judged(story.data, second, CLASS)
    measured = set(challenger["problem_id"])
    assert set(champion["problem_id"]) == measured
    assert len(champion) == len(challenger) == 2 * SETTINGS.test_problems
    for other in (source_of(story.data, first, CLASS), held_back(story.data, first, CLASS)):
        assert measured.isdisjoint(other.problem("collect", i).id for i in range(200))
        assert measured.isdisjoint(other.problem("test", i).id for i in range(200))
    taught = read_experiences(run_folder(story.data, second).experiences(CLASS))
    assert measured.isdisjoint(each.problem.id for each in taught)


def test_what_is_taken_over_is_what_would_be_made_anew(story: Story) -> None:
    assert 0 < story.seen["taken"] <= SETTINGS.experiences
    assert story.seen["taken anew"] == 0
    assert story.seen["anew is the same"]


def test_without_news_nothing_is_done(story: Story) -> None:
    assert story.seen["without news"] == 0
    assert "Nothing new" in story.seen["dry without news"]


def test_a_dry_run_says_what_is_new_and_writes_nothing(story: Story, tmp_path: Path) -> None:
    assert " 3 " in story.seen["dry with three"]
    assert " of 4" in story.seen["dry with three"]
    assert not story.seen["dry runs wrote"]
    (line,) = dry_run(tmp_path / "nowhere", SETTINGS)
    assert "would make the first champions" in str(line)
    assert not (tmp_path / "nowhere").exists()


def test_a_challenger_that_learned_nonsense_is_refused(story: Story) -> None:
    state = story.seen["nonsense"]
    assert _last(state)["verdict"] == REFUSED
    assert state["champion"] == 2
    assert "is refused, against version 2: " in story.seen["nonsense said"]


def test_the_same_experiences_are_not_judged_until_they_pass(story: Story) -> None:
    assert story.seen["nonsense again"] == story.seen["nonsense"]
    assert "version 3 was refused; nothing new was learned" in story.seen["nonsense again said"]


def test_a_rollback_restores_the_champion_before(story: Story) -> None:
    state = story.seen["rolled back"]
    assert state["champion"] == 1
    assert state["versions"][1]["verdict"] == ROLLED_BACK
    assert "to roll back to" in story.seen["rolled back twice"]
    assert story.seen["after rollback"] == 0  # what was rolled back does not come back by itself


def test_a_registry_that_cannot_be_reached_is_one_line_and_changes_nothing(story: Story) -> None:
    assert "registry at http://127.0.0.1:9 cannot be used" in story.seen["unreachable said"]
    assert "\n" not in story.seen["unreachable said"]
    assert story.seen["unreachable"]["champion"] == 1


def test_a_crash_leaves_the_champion_and_the_same_command_goes_on(story: Story) -> None:
    crashed, after = story.seen["crashed"], story.seen["awaiting"]
    assert crashed["champion"] == 1
    assert len(after["versions"]) == len(crashed["versions"])  # what the crash left was found again
    assert _last(after)["learned"] == after["learned"] == _last(crashed)["learned"]
    assert "verdict" not in _last(crashed)
    assert _last(after)["verdict"] == AWAITING


def test_a_challenger_awaits_approval_where_it_should(story: Story) -> None:
    awaiting, approved = story.seen["awaiting"], story.seen["approved"]
    assert awaiting["champion"] == 1
    assert (_last(awaiting)["verdict"], awaiting["challenger"]) == (AWAITING, _last(awaiting)["number"])
    assert approved["champion"] == awaiting["challenger"]
    assert approved["challenger"] is None
    assert "awaits approval" in story.seen["approved twice"]


def test_two_at_once_are_refused_in_one_line(story: Story, capsys: pytest.CaptureFixture[str]) -> None:
    from flows.cli.main import call

    with open_data_folder(story.data).lock():
        assert call(["retrain", "--preset", "smoke", "--data", story.data]) == 1
    told = capsys.readouterr().err
    assert "is in use by another command" in told
    assert told.count("\n") == 1
