"""Retrain a library: gather it with what was learned, and promote it if robots are there sooner with it."""

from __future__ import annotations

from pathlib import Path

from prefect import flow

from flows.gather import gather
from tasks.champions.retraining_schedule import log_if_scheduled
from tasks.libraries.pending_library import library_retraining
from tasks.libraries.retrain_library import RetrainedLibrary
from tasks.libraries.retrain_library import retrain_library as task
from tasks.requests.import_worlds import Unknown, import_settings


@flow(name="retrain-library", flow_run_name="retrain-library {name}", persist_result=False)
def retrain_library(
    name: str,
    sources: list[str],
    data: str,
    plans: int,
    poses: float,
    difficulty: str,
    vehicle: str,
    seed: int,
    test_problems: int,
    approve: bool = False,
    workers: int = 1,
    scale: float | None = None,
    resolution: float | None = None,
    unknown: Unknown = "occupied",
    tolerance: float = 0.0,
) -> RetrainedLibrary | None:
    """Do what ``motion-memory retrain-library`` does with the same options."""
    settings = import_settings(
        vehicle, seed, scale=scale, resolution=resolution, unknown=unknown, tolerance=tolerance
    )
    asked = library_retraining(name, sources, plans, poses, difficulty, settings, test_problems, approve)
    made = task(Path(data), asked, workers, gather)
    if made is not None:
        log_if_scheduled(made.summary, made.beside)
    return made
