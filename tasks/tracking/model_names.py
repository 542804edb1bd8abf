"""The names of memories as logged and registered models in MLflow."""

from __future__ import annotations

from typing import Final

from tasks.settings.run_settings import DEFAULT_VEHICLE

PREFIX: Final = "motion-memory-"


def registered_name(memory: str, vehicle: str) -> str:
    """The name of a memory in MLflow; unless the vehicle is the car, the name ends with the vehicle."""
    return PREFIX + memory + ("" if vehicle == DEFAULT_VEHICLE else f"-{vehicle}")
