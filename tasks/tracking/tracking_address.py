"""The address of MLflow. Robots use this too, so it needs neither MLflow nor tables."""

from __future__ import annotations

import os

from storage.places.data_folder import DataFolder
from tasks.settings.errors import UsageError


def tracking_uri(data: DataFolder) -> str:
    """The address of MLflow: MLFLOW_TRACKING_URI if it is set, else of a database in the data folder.

    Raises UsageError if the data folder is in object storage, which cannot hold a database.
    """
    uri = os.environ.get("MLFLOW_TRACKING_URI")
    if not uri and data.is_remote:
        raise UsageError(
            f"{data.place} cannot hold an MLflow database: set MLFLOW_TRACKING_URI to an MLflow server that "
            "has its own (docs/runbook.md)."
        )
    return uri or f"sqlite:///{data.mlflow_database}"
