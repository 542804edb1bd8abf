"""Memories that MLflow keeps: ``models:/name/1``, ``models:/name@alias``, ``runs:/<run>/<model>``.

They are downloaded, and then checked and read as any other archive; no code of theirs runs.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from planners.memory.recall import Memory
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.memories import load_memory
from storage.places.data_folder import DataFolder
from storage.places.mirror import folders_here
from tasks.servers.access import auth_environment
from tasks.servers.prefect_server import ENVIRONMENT
from tasks.settings.redaction import redacted
from tasks.settings.run_settings import RunError, default_data
from tasks.tracking.mlflow_runs import tracking_uri

URI: Final = re.compile(r"(models|runs|mlflow-artifacts):/.*")
_SETTINGS: Final = {
    **{name: value for name, value in ENVIRONMENT.items() if name.startswith("MLFLOW_")},
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2",  # somebody waits
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}


def set_mlflow_environment() -> None:
    """Quiet and impatient defaults of MLflow and its password, where the user has not decided otherwise."""
    for name, value in (_SETTINGS | auth_environment()).items():
        os.environ.setdefault(name, value)


def is_model_uri(place: str) -> bool:
    """Whether a place is MLflow's to find rather than a folder."""
    return URI.fullmatch(place) is not None


@contextmanager
def memory_folder(place: str | None) -> Iterator[Path | None]:
    """The folder at a place: itself, or what MLflow keeps, downloaded for as long as this lasts.

    RunError: MLflow does not answer, or holds no such model.
    """
    if place is None or not is_model_uri(place):
        yield place if place is None else folders_here(place, "memories")
        return
    with TemporaryDirectory(prefix="motion-memory-") as scratch:
        yield download(place, scratch, _tracking_uri(place))


def memory_digest(folder: Path | None) -> str:
    """A digest of the memories in a folder, whose headers hold the checksums of all else."""
    digest = hashlib.sha256()
    if folder is not None:
        for header in sorted([folder / "memory.json", *folder.glob("memories/[!.]*/memory.json")]):
            if header.is_file():
                digest.update(f"{header.relative_to(folder)}\0".encode())
                digest.update(header.read_bytes())
    return digest.hexdigest()


def load_from(place: str, vehicle: Vehicle) -> Memory:
    """The memory in a folder, or of a model in MLflow at $MLFLOW_TRACKING_URI or in the usual data folder.

    RunError: MLflow does not answer, or holds no such model. StorageError: there is no good archive.
    """
    if is_model_uri(place):
        return _registered(place, vehicle)
    return load_memory(folders_here(place, "memories"), vehicle)


def _registered(uri: str, vehicle: Vehicle) -> Memory:
    with TemporaryDirectory(prefix="motion-memory-") as scratch:  # mapped files outlive their names
        return load_memory(download(uri, scratch, _tracking_uri(uri)), vehicle)


def download(uri: str, scratch: str, where: str) -> Path:
    """The memory of a model in MLflow at ``where``, downloaded into a folder.

    RunError: MLflow does not answer, or holds no such model.
    """
    set_mlflow_environment()
    from unittest.mock import patch

    from mlflow.artifacts import download_artifacts

    try:
        with patch.dict(os.environ, {"MLFLOW_TRACKING_URI": where}):  # of all that MLflow asks on the way
            folder = Path(download_artifacts(uri, dst_path=scratch))
    except Exception as error:  # each of MLflow's stores has errors of its own
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise RunError(redacted(f"{uri} cannot be had from MLflow at {where}: {reason}")) from error
    found = sorted(header.parent for header in folder.rglob("memory.json"))
    if len(found) != 1:
        raise RunError(
            redacted(f"{uri} in MLflow at {where} holds {len(found)} memories; name a model with one.")
        )
    return found[0]


def _tracking_uri(uri: str) -> str:
    folder = DataFolder(default_data().absolute())
    if not os.environ.get("MLFLOW_TRACKING_URI") and not folder.mlflow_database.is_file():
        raise RunError(
            f"{uri} is MLflow's to find, but there is none: {folder.mlflow_database} does not exist. "
            "Set MLFLOW_TRACKING_URI, or MOTION_MEMORY_DATA to the data folder of the run."
        )
    return tracking_uri(folder)
