"""Memories by their address in MLflow: ``models:/name/1``, ``models:/name@alias``, ``runs:/<run>/<model>``.

A memory is downloaded, and then checked and read like any other archive. None of the code that MLflow keeps
beside it runs.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.libraries import HEADERS, load_memory_or_library
from storage.places.data_folder import DataFolder
from storage.places.mirror import folders_here
from storage.places.scratch import scratch_folder
from tasks.servers.access import auth_environment
from tasks.servers.prefect_server import ENVIRONMENT
from tasks.settings.environment import default_data, environment
from tasks.settings.errors import RunError
from tasks.settings.redaction import redacted
from tasks.tracking.mlflow_database import ready_database
from tasks.tracking.tracking_address import tracking_uri

URI: Final = re.compile(r"(models|runs|mlflow-artifacts):/.*")
_SETTINGS: Final = {
    **{name: value for name, value in ENVIRONMENT.items() if name.startswith("MLFLOW_")},
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2",  # a user waits
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}


def set_mlflow_environment() -> None:
    """Set quiet defaults with short timeouts for MLflow, and its password, unless the user has set them."""
    for name, value in (_SETTINGS | auth_environment()).items():
        os.environ.setdefault(name, value)


def is_model_uri(address: str) -> bool:
    """Whether an address is one of MLflow rather than a folder."""
    return URI.fullmatch(address) is not None


@contextmanager
def memory_folder(address: str | None) -> Iterator[Path | None]:
    """The folder of memories at an address; a model in MLflow is kept while the context lasts.

    An address of None has no folder. Raises RunError if MLflow does not answer or holds no such model.
    """
    if address is None or not is_model_uri(address):
        yield address if address is None else folders_here(address, "memories")
        return
    with scratch_folder() as scratch:
        yield download(address, str(scratch), _tracking_uri(address))


def memory_digest(folder: Path | None) -> str:
    """A digest of the memories in a folder: of their headers, which hold the checksums of everything else."""
    digest = hashlib.sha256()
    if folder is not None:
        own = [folder / header for header in HEADERS]
        for header in sorted([*own, *folder.glob("memories/[!.]*/memory.json")]):
            if header.is_file():
                digest.update(f"{header.relative_to(folder)}\0".encode())
                digest.update(header.read_bytes())
    return digest.hexdigest()


def load_from(address: str, vehicle: Vehicle) -> Memory | PlanLibrary:
    """The memory or library at an address: a folder, or a model in MLflow.

    MLflow is the one at $MLFLOW_TRACKING_URI, or in the usual data folder. Raises RunError if it does not
    answer or holds no such model, and StorageError if the archive is damaged or of another vehicle.
    """
    with memory_folder(address) as folder:  # a mapped file stays readable after it is deleted
        assert folder is not None  # only an address of None has no folder
        return load_memory_or_library(folder, vehicle)


def download(uri: str, scratch: str, server: str) -> Path:
    """Download a model's memory or library from MLflow.

    Args:
        uri: the model: ``models:/…`` or ``runs:/…``.
        scratch: the folder to put it into.
        server: the tracking URI of MLflow.

    Returns:
        the memory's folder.

    Raises:
        RunError: MLflow does not answer, or holds no such model.
    """
    set_mlflow_environment()
    from mlflow.artifacts import download_artifacts

    try:
        with environment(MLFLOW_TRACKING_URI=server):  # read by every part of MLflow that takes part
            folder = Path(download_artifacts(uri, dst_path=scratch))
    except Exception as error:  # each of MLflow's stores has its own errors
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise RunError(redacted(f"{uri} cannot be fetched from MLflow at {server}: {reason}")) from error
    memories = sorted(found.parent for header in HEADERS for found in folder.rglob(header))
    if len(memories) != 1:
        raise RunError(
            redacted(f"{uri} in MLflow at {server} holds {len(memories)} memories; name a model with one.")
        )
    return memories[0]


def _tracking_uri(uri: str) -> str:
    folder = DataFolder(default_data().absolute())
    if not os.environ.get("MLFLOW_TRACKING_URI"):
        if not folder.mlflow_database.is_file():
            raise RunError(
                f"{uri} is an address in MLflow, but {folder.mlflow_database} does not exist. "
                "Set MLFLOW_TRACKING_URI, or MOTION_MEMORY_DATA to the data folder of the run."
            )
        ready_database(folder)
    return tracking_uri(folder)
