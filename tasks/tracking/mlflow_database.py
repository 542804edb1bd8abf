"""Make MLflow's database in a data folder, or upgrade it to the schema of the installed MLflow.

MLflow changes the tables one by one, and a kill in between leaves a database that nothing can open. Therefore
a copy is upgraded and then replaces the database in one step. The old database is kept beside it.
"""

from __future__ import annotations

import functools
import logging
import os
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Final

from storage.places.data_folder import DataFolder
from storage.places.files import locked, whole_file
from tasks.settings.errors import RunError

OWNER_ONLY: Final = 0o600

_LOG = logging.getLogger(__name__)

if TYPE_CHECKING:
    from alembic.script import ScriptDirectory


def ready_database(data: DataFolder) -> None:
    """Create the database of a data folder if there is none; upgrade it if an older MLflow made it.

    Raises:
        RunError: a newer MLflow made the database.
        InUseError: another command is making or upgrading it.
    """
    path = data.mlflow_database
    if path.exists() and _schema_of(path) == _schemas().get_current_head():
        return
    with locked(path.with_name(f".{path.name}.lock"), str(path)):
        if not path.exists():
            _make(path, data.mlflow_artifacts.as_uri())
        elif _schema_of(path) != _schemas().get_current_head():
            _upgrade(path, _schemas())


def _make(path: Path, artifacts: str) -> None:
    from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

    _remove_leftovers(path)
    with whole_file(path, mode=OWNER_ONLY) as temporary:
        store = SqlAlchemyStore(f"sqlite:///{temporary}", artifacts)  # type: ignore[no-untyped-call]  # MLflow's
        store.engine.dispose()


def _upgrade(path: Path, schemas: ScriptDirectory) -> None:
    from alembic.util import CommandError
    from mlflow.store.db.utils import _upgrade_db
    from sqlalchemy import create_engine

    old = _schema_of(path)
    try:
        schemas.get_revision(old)
    except CommandError:
        raise RunError(
            f"{path} was written by a newer MLflow (schema {old}); install that version again, or give "
            "another data folder."
        ) from None
    _remove_leftovers(path)
    kept = path.with_name(f"{path.name}.{old}")
    with whole_file(path, mode=OWNER_ONLY) as temporary:
        with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(temporary)) as copy:
            source.backup(copy)
        engine = create_engine(f"sqlite:///{temporary}")
        _upgrade_db(engine)  # type: ignore[no-untyped-call]  # MLflow's
        engine.dispose()
        if not kept.exists():
            os.link(path, kept)
    _LOG.warning("%s now has this MLflow's schema; the old database is kept as %s", path, kept.name)


@functools.cache
def _schemas() -> ScriptDirectory:
    """All schemas that the installed MLflow knows."""
    import mlflow.store
    from alembic.script import ScriptDirectory

    return ScriptDirectory(str(Path(mlflow.store.__path__[0]) / "db_migrations"))


def _schema_of(path: Path) -> str:
    with closing(sqlite3.connect(path)) as database:
        ((schema,),) = database.execute("SELECT version_num FROM alembic_version").fetchall()
    return str(schema)


def _remove_leftovers(path: Path) -> None:
    """Delete unfinished copies of a killed command; the lock keeps others from making one meanwhile."""
    for left in path.parent.glob(f".{path.name}.*.partial*"):
        left.unlink()
