"""Champions in a real registry: who changes them, when, and who may not."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from storage.archives.memories import save_memory
from storage.places.data_folder import open_data_folder
from tasks.champions.conclude import settle
from tasks.champions.new_experience import next_number, runs_to_make
from tasks.champions.promote import ChampionChange, promote, promote_awaiting, roll_back
from tasks.registry.champion_registry import (
    AWAITING,
    CHALLENGER,
    FIRST,
    PROMOTED,
    ROLLED_BACK,
    Registry,
    Version,
)
from tasks.settings.errors import RunError
from tasks.settings.presets import for_preset
from tests.prepared.mlflow_database import LOUD_LIBRARIES, with_mlflow_database
from tests.storage.samples import a_memory

NAME = "motion-memory-trap"
pytestmark = LOUD_LIBRARIES


class Registered:
    """A data folder with one logged memory, of which any number of versions can be made."""

    def __init__(self, data: Path, run_id: str, model_id: str) -> None:
        self.data, self.run_id, self.model_id = data, run_id, model_id
        self.registry = Registry(open_data_folder(data))

    def copied(self, data: Path) -> Registered:
        """The same in another data folder; the memory's own files stay where they were logged."""
        copy = open_data_folder(data).mlflow_database
        shutil.copyfile(open_data_folder(self.data).mlflow_database, copy)
        return Registered(data, self.run_id, self.model_id)

    def version(self, key: str, name: str = NAME, **tags: Any) -> Version:
        tags = {"memory": "trap"} | tags
        return self.registry.register(name, self.run_id, self.model_id, key, tags, "told")

    @property
    def champion(self) -> int | None:
        found = self.registry.aliased(NAME)
        return found and found.number


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Registered:
    """The memory is logged once; no version is made of it here."""
    from tasks.tracking.mlflow_runs import Tracker

    place = tmp_path_factory.mktemp("logged")
    save_memory(place / "archive", a_memory(3))
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        tracker = Tracker(open_data_folder(with_mlflow_database(place / "data")))
        with tracker.run("r", "train trap", {}) as run_id:
            model_id = tracker.memory(run_id, "memory", place / "archive", "car")
        return Registered(place / "data", run_id, model_id)


@pytest.fixture
def registered(logged: Registered, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registered:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    return logged.copied(tmp_path / "data")


def test_a_registry_that_is_not_there_holds_nothing_and_is_not_made(tmp_path: Path) -> None:
    folder = open_data_folder(tmp_path / "data")
    registry = Registry(folder)
    assert (registry.names(), registry.versions(NAME), registry.aliased(NAME)) == ([], [], None)
    assert not folder.mlflow_database.exists()


def test_champions_change_by_promotion_and_back_and_no_other_way(registered: Registered) -> None:
    registry, data = registered.registry, registered.data
    first = registered.version("one", verdict=FIRST)
    assert registered.champion is None
    registry.set_alias(first)
    second = registered.version("two", against=1, retraining=1)
    assert registered.version("two", against=1, retraining=1) == second  # the same again is no other
    assert [each.number for each in registry.versions(NAME)] == [1, 2]
    promote(registry, second)
    promote(registry, second)
    assert registered.champion == 2

    late = registered.version("three", against=1, retraining=2)
    with pytest.raises(RunError, match="judged against version 1, but the champion is version 2 now"):
        promote(registry, late)
    with pytest.raises(RunError, match="awaits approval"):
        promote_awaiting(data, None)
    waiting = registered.version("four", against=2, retraining=3, verdict=AWAITING)
    registry.set_alias(waiting, CHALLENGER)
    assert registered.champion == 2
    promote_awaiting(data, "trap")
    assert registered.champion == 4
    assert registry.aliased(NAME, CHALLENGER) is None
    assert registry.versions(NAME)[-1].tag("verdict") == PROMOTED

    roll_back(data, None)
    assert registered.champion == 2
    assert roll_back(data, NAME) == [ChampionChange(NAME, before=2, now=1)]
    assert registered.champion == 1
    for memory in (None, "trap"):
        with pytest.raises(RunError, match="to roll back to"):
            roll_back(data, memory)
    with pytest.raises(RunError, match=r"No memory 'curves' in the registry. Known: motion-memory-trap"):
        roll_back(data, "curves")
    assert registered.champion == 1


def test_a_challenger_whose_champion_was_rolled_back_is_not_approved(registered: Registered) -> None:
    registry = registered.registry
    registry.set_alias(registered.version("one", verdict=FIRST))
    promote(registry, registered.version("two", against=1, retraining=1))
    waiting = registered.version("three", against=2, retraining=2, verdict=AWAITING)
    registry.set_alias(waiting, CHALLENGER)
    roll_back(registered.data, None)
    with pytest.raises(RunError, match="judged against version 2, but the champion is version 1 now"):
        promote_awaiting(registered.data, None)
    assert registered.champion == 1


def test_the_others_are_promoted_beside_one_whose_champion_has_changed(registered: Registered) -> None:
    registry = registered.registry
    for name, against in ((f"{NAME}-a", 2), (NAME, 1), (f"{NAME}-b", 2)):
        registry.set_alias(registered.version("one", name, verdict=FIRST))
        waiting = registered.version("two", name, against=against, retraining=1, verdict=AWAITING)
        registry.set_alias(waiting, CHALLENGER)
    told = rf"{NAME}-a version 2 .*{NAME}-b version 2 .* Promoted: {NAME} version 2"
    with pytest.raises(RunError, match=told):
        promote_awaiting(registered.data, None)
    numbers = [found and found.number for found in map(registry.aliased, (f"{NAME}-a", NAME, f"{NAME}-b"))]
    assert numbers == [1, 2, 1]
    assert registry.aliased(NAME, CHALLENGER) is None
    with pytest.raises(RunError, match=rf"{NAME}-a version 2 "):
        promote_awaiting(registered.data, f"{NAME}-a")


def test_other_memories_have_their_verdicts_beside_one_whose_champion_has_changed(
    registered: Registered,
) -> None:
    registry, names = registered.registry, (f"{NAME}-a", NAME, f"{NAME}-b")
    challengers = []
    for name, against in zip(names, (2, 1, 1), strict=True):
        registry.set_alias(registered.version("one", name, verdict=FIRST))
        challengers.append(registered.version("two", name, against=against, retraining=1))
    faults = settle(registry, [(each, PROMOTED) for each in challengers])
    assert len(faults) == 1
    assert f"{NAME}-a version 2" in faults[0]
    assert [found and found.number for found in map(registry.aliased, names)] == [1, 2, 2]
    assert [registry.versions(name)[-1].tag("verdict") for name in names] == ["", PROMOTED, PROMOTED]


def test_the_run_that_made_a_version_says_what_became_of_it(registered: Registered) -> None:
    from mlflow import MlflowClient

    def told() -> str:
        return str(client.get_run(registered.run_id).data.tags["verdict"])

    registry, client = registered.registry, MlflowClient(registered.registry.uri)
    assert settle(registry, [(registered.version("one"), FIRST)]) == []
    assert told() == FIRST
    assert settle(registry, [(registered.version("two", against=1, retraining=1), AWAITING)]) == []
    assert told() == AWAITING
    promote_awaiting(registered.data, None)
    assert told() == PROMOTED
    client.delete_run(registered.run_id)  # which keeps no version from its verdict
    roll_back(registered.data, None)
    assert [each.tag("verdict") for each in registry.versions(NAME)] == [FIRST, ROLLED_BACK]


def test_a_rollback_that_was_killed_goes_back_by_one_version_when_it_is_given_again(
    registered: Registered, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry = registered.registry
    registry.set_alias(registered.version("one", verdict=FIRST))
    for against in (1, 2):
        promote(registry, registered.version(str(against), against=against, retraining=against))
    written: list[bool] = []

    def killed_after_one(write: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*arguments: Any) -> Any:
            if written:
                raise KeyboardInterrupt
            written.append(True)
            return write(*arguments)

        return wrapped

    with monkeypatch.context() as patch:
        for name in ("set_alias", "set_tags"):
            patch.setattr(Registry, name, killed_after_one(getattr(Registry, name)))
        with pytest.raises(KeyboardInterrupt):
            roll_back(registered.data, None)
    roll_back(registered.data, None)
    assert registered.champion == 2
    assert registry.versions(NAME)[-1].tag("verdict") == ROLLED_BACK


def test_a_champion_whose_promotion_was_killed_gets_its_verdict_by_the_next_retraining(
    registered: Registered,
) -> None:
    registry = registered.registry
    registry.set_alias(registered.version("one"))
    settings = for_preset("smoke", classes=["trap"])
    assert runs_to_make(open_data_folder(registered.data), settings, registry) == []
    assert [each.tag("verdict") for each in registry.versions(NAME)] == [FIRST]
    promote(registry, registered.version("two", against=1, retraining=1))
    assert runs_to_make(open_data_folder(registered.data), settings, registry) == []
    assert [each.tag("verdict") for each in registry.versions(NAME)] == [FIRST, PROMOTED]


def test_where_there_is_no_data_nothing_is_made(tmp_path: Path) -> None:
    for change in (roll_back, promote_awaiting):
        with pytest.raises(RunError, match="is not a data folder"):
            change(tmp_path / "nowhere", None)
    assert not (tmp_path / "nowhere").exists()


def test_a_rollback_of_which_one_part_cannot_be_done_changes_nothing(registered: Registered) -> None:
    registry, other = registered.registry, "motion-memory-curves"
    for name, previous in ((other, "1"), (NAME, "99")):
        registry.set_alias(registered.version("one", name, verdict=FIRST))
        registry.set_alias(registered.version("two", name, retraining=1, previous=previous))
    with pytest.raises(RunError, match="version 99"):
        roll_back(registered.data, None)
    for name in (NAME, other):
        champion = registry.aliased(name)
        assert champion is not None
        assert champion.number == 2


def test_a_registry_that_was_opened_before_anything_was_logged_sees_what_is_registered(
    logged: Registered, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    early = Registry(open_data_folder(tmp_path / "data"))
    assert early.names() == []
    logged.copied(tmp_path / "data").version("one")
    assert early.names() == [NAME]


def test_a_library_is_rolled_back_by_its_name_alone_and_counts_its_own_retrainings(
    registered: Registered,
) -> None:
    registry, data = registered.registry, registered.data
    bus = "motion-memory-lots-bus"
    for number in (1, 2):
        version = registered.version(str(number), bus, recipe="r", retraining=number, verdict=PROMOTED)
        registry.set_tags(version, {"previous": number - 1} if number > 1 else {})
        registry.set_alias(version)
    assert (next_number(registry, bus), next_number(registry)) == (3, 1)
    with pytest.raises(RunError, match="to roll back to"):
        roll_back(data, None)
    registry.set_alias(registered.version("tram", "motion-memory-lots-tram", recipe="r", verdict=FIRST))
    with pytest.raises(RunError, match="motion-memory-lots-bus, motion-memory-lots-tram"):
        roll_back(data, "lots")
    assert roll_back(data, "lots-bus") == [ChampionChange(bus, before=2, now=1)]
    with pytest.raises(RunError, match="to roll back to"):
        roll_back(data, "lots-tram")
