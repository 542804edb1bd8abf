"""MLflow's database without a run: to make one takes a second, and several on a slow disk."""

from __future__ import annotations

import shutil
import sqlite3
import warnings
from contextlib import closing
from pathlib import Path

import pytest

from storage.places.data_folder import open_data_folder
from tasks.tracking.mlflow_database import OWNER_ONLY, ready_database
from tests.prepared.made_once import made_once

LOUD_LIBRARIES = pytest.mark.filterwarnings(  # of MLflow's libraries among themselves
    "ignore:.*type hint:UserWarning",
    "ignore:Operation with range",
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
    "ignore::ResourceWarning",
)


def _make(home: Path) -> Path:
    data = open_data_folder(home)
    with warnings.catch_warnings(action="ignore"):  # of MLflow's libraries among themselves
        ready_database(data)
    return data.mlflow_database


def with_mlflow_database(data: Path) -> Path:
    """Put it into a data folder, which is made if it is not there; return the folder."""
    folder = open_data_folder(data)
    copy = shutil.copyfile(made_once("mlflow", _make), folder.mlflow_database)
    copy.chmod(OWNER_ONLY)
    with closing(sqlite3.connect(copy)) as database, database:
        artifacts = f"{folder.mlflow_artifacts.as_uri()}/0"
        database.execute("UPDATE experiments SET artifact_location = ?", (artifacts,))
    return data
