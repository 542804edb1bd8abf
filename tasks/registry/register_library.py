"""Libraries of plans in MLflow: a run for each, with its numbers, and a version of a registered model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.places.data_folder import DataFolder, open_data_folder
from storage.vehicles.vehicle_files import text_of
from tasks.registry.champion_registry import Registry
from tasks.registry.model_uris import memory_digest, set_mlflow_environment
from tasks.servers.prefect_server import set_environment
from tasks.settings.environment import default_data
from tasks.tracking.mlflow_runs import MEMORY_TAG, MODEL_TAG, tracker

STAGE: Final = "gather"


class LoggedLibrary(NamedTuple):
    """A library in MLflow."""

    run_id: str  # the run that tells how it was gathered
    model_id: str
    digest: str  # of the library


def register_library(
    name: str, folder: Path, vehicle: Vehicle, parameters: Mapping[str, Any], metrics: Mapping[str, float]
) -> str:
    """Log a library in MLflow and register it; the same library always becomes the same version.

    MLflow is the one at $MLFLOW_TRACKING_URI, or in the usual data folder.

    Args:
        name: of the registered model.
        folder: the library.
        vehicle: whose plans it holds.
        parameters: how it was gathered.
        metrics: the results of gathering.

    Returns:
        the address that ``--memory`` takes.

    Raises:
        RunError: MLflow does not answer.
    """
    data = open_data_folder(default_data())
    logged = log_library(data, name, folder, vehicle, parameters, metrics)
    tags = {"memory": name}
    return Registry(data).register(name, *logged, tags, "A library of plans").uri


def log_library(
    data: DataFolder,
    name: str,
    folder: Path,
    vehicle: Vehicle,
    parameters: Mapping[str, Any],
    metrics: Mapping[str, float],
) -> LoggedLibrary:
    """Log a library in MLflow, once; the arguments are those of ``register_library``, and a data folder.

    Raises RunError if MLflow does not answer.
    """
    set_environment(data.path)
    set_mlflow_environment()
    digest, log = memory_digest(folder), tracker(data.place)
    title = f"library {name} {digest[:8]}"
    with log.run(title, STAGE, {}) as run_id:
        if not log.is_logged(run_id, digest, "memory"):
            log.parameters(run_id, {**parameters, "vehicle": name_of(vehicle)})
            model_id = log.memory(run_id, name, folder, text_of(vehicle))
            log.tag(run_id, {MEMORY_TAG: name, MODEL_TAG: model_id})
            log.metrics(run_id, [metrics], model_id=model_id)
            log.mark_logged(run_id, digest, "memory")
    return LoggedLibrary(*log.logged_memory(title, name, digest), digest)
