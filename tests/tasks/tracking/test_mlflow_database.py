"""MLflow's database under upgrades: whole before and after, whatever is killed when."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from flows.cli.terminal import notices_shown
from storage.errors import InUseError
from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.files import locked
from tasks.registry.champion_registry import Registry
from tasks.settings.errors import RunError
from tasks.tracking.mlflow_database import ready_database
from tasks.tracking.mlflow_runs import Tracker

OLD = "2c33131f4dae"  # a schema of MLflow 3, twenty changes before this one's
ASK = "SELECT name FROM experiments"

pytestmark = pytest.mark.filterwarnings("ignore")  # of MLflow's libraries among themselves


@pytest.fixture(scope="module")
def old_database(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A database of an older MLflow with one experiment."""
    from alembic import command
    from mlflow.store.db.utils import _get_alembic_config
    from mlflow.store.tracking.dbmodels.initial_models import Base
    from sqlalchemy import create_engine

    path = tmp_path_factory.mktemp("old") / "mlflow.db"
    engine = create_engine(f"sqlite:///{path}")
    Base.metadata.create_all(engine)
    with engine.begin() as connection:
        config = _get_alembic_config(str(engine.url))
        config.attributes["connection"] = connection
        command.upgrade(config, OLD)
    engine.dispose()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("INSERT INTO experiments (name, lifecycle_stage) VALUES ('of then', 'active')")
    return path.read_bytes()


@pytest.fixture
def data(old_database: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DataFolder:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    data = open_data_folder(tmp_path)
    data.mlflow_database.write_bytes(old_database)
    return data


def ask(path: Path, question: str) -> list[Any]:
    with closing(sqlite3.connect(path)) as database:
        return [row[0] for row in database.execute(question).fetchall()]


@pytest.mark.parametrize(
    "use", [lambda data: Tracker(data).find("run", "run"), lambda data: Registry(data).names()]
)
def test_a_database_of_an_older_mlflow_is_upgraded_by_whoever_comes_first_and_kept(
    data: DataFolder, use: Callable[[DataFolder], Any], capsys: pytest.CaptureFixture[str]
) -> None:
    with notices_shown():
        use(data)
    assert "of then" in ask(data.mlflow_database, ASK)
    kept = data.mlflow_database.with_name(f"mlflow.db.{OLD}")
    assert ask(kept, "SELECT version_num FROM alembic_version") == [OLD]
    assert kept.name in capsys.readouterr().err
    with notices_shown():
        use(data)
    assert capsys.readouterr().err == ""


def test_an_upgrade_that_is_killed_changes_nothing_and_the_next_command_upgrades(
    data: DataFolder, old_database: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow.store.db import utils

    upgrade = utils._upgrade_db

    def killed(engine: Any) -> None:
        upgrade(engine)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(utils, "_upgrade_db", killed)
        with pytest.raises(KeyboardInterrupt):
            ready_database(data)
    assert data.mlflow_database.read_bytes() == old_database
    left = data.path / ".mlflow.db.killed.partial"
    left.write_bytes(b"what a killed process could not remove")
    ready_database(data)
    assert "of then" in ask(data.mlflow_database, ASK)
    assert not left.exists()


def test_two_commands_do_not_upgrade_at_once(data: DataFolder) -> None:
    with (
        locked(data.path / ".mlflow.db.lock", "it"),
        pytest.raises(InUseError, match=r"mlflow\.db is in use"),
    ):
        ready_database(data)


def test_a_database_of_a_newer_mlflow_is_refused_in_one_line_and_not_touched(data: DataFolder) -> None:
    with closing(sqlite3.connect(data.mlflow_database)) as database, database:
        database.execute("UPDATE alembic_version SET version_num = 'of2099'")
    before = data.mlflow_database.read_bytes()
    for use in (lambda: Tracker(data).find("run", "run"), lambda: Registry(data).names()):
        with pytest.raises((RunError, RuntimeError), match=r"newer MLflow \(schema of2099\)") as refusal:
            use()
        assert "\n" not in str(refusal.value)
    assert data.mlflow_database.read_bytes() == before
