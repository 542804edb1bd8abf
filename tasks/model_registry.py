"""Memories that MLflow keeps: ``models:/name/1``, ``models:/name@alias``, ``runs:/<run>/<model>``.

They are downloaded, and then checked and read as any other archive; no code of theirs runs.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest.mock import patch

from planners.memory.recall import Memory
from planners.world.vehicle import Vehicle
from storage.layout import DataFolder
from storage.memories import load_memory
from tasks.local_server import ENVIRONMENT
from tasks.settings import RunError, default_data
from tasks.tracking import tracking_uri

URI: Final = re.compile(r"(models|runs|mlflow-artifacts):/.*")
_SETTINGS: Final = {
    **{name: value for name, value in ENVIRONMENT.items() if name.startswith("MLFLOW_")},
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2",  # somebody waits
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}


def is_model_uri(place: str) -> bool:
    """Whether a place is MLflow's to find rather than a folder."""
    return URI.fullmatch(place) is not None


def load_from(place: str, vehicle: Vehicle) -> Memory:
    """The memory in a folder, or of a model in MLflow at $MLFLOW_TRACKING_URI or in the usual data folder.

    RunError: MLflow does not answer, or holds no such model. StorageError: there is no good archive.
    """
    return _registered(place, vehicle) if is_model_uri(place) else load_memory(Path(place), vehicle)


def _registered(uri: str, vehicle: Vehicle) -> Memory:
    where = _tracking_uri(uri)
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    from mlflow.artifacts import download_artifacts

    with (
        TemporaryDirectory(prefix="motion-memory-") as scratch,  # mapped files outlive their names
        patch.dict(os.environ, {"MLFLOW_TRACKING_URI": where}),  # of all that MLflow asks on the way
    ):
        try:
            folder = Path(download_artifacts(uri, dst_path=scratch))
        except Exception as error:  # each of MLflow's stores has errors of its own
            reason = " ".join(str(error).split())[:300] or type(error).__name__
            raise RunError(f"{uri} cannot be had from MLflow at {where}: {reason}") from error
        found = sorted(header.parent for header in folder.rglob("memory.json"))
        if len(found) != 1:
            raise RunError(f"{uri} in MLflow at {where} holds {len(found)} memories; name a model with one.")
        return load_memory(found[0], vehicle)


def _tracking_uri(uri: str) -> str:
    folder = DataFolder(default_data().absolute())
    if not os.environ.get("MLFLOW_TRACKING_URI") and not folder.mlflow_database.is_file():
        raise RunError(
            f"{uri} is MLflow's to find, but there is none: {folder.mlflow_database} does not exist. "
            "Set MLFLOW_TRACKING_URI, or MOTION_MEMORY_DATA to the data folder of the run."
        )
    return tracking_uri(folder)
