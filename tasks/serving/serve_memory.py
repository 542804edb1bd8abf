"""Serve a memory over HTTP: worker processes share one port, which opens when the first is ready."""

from __future__ import annotations

import functools
import json
import logging
import math
import os
from pathlib import Path

from planners.drive_answers import first_question
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.world.vehicles.vehicle import name_of
from storage.archives.libraries import load_memory_or_library
from storage.exchange.problems import fields_of
from storage.vehicles.vehicle_files import said_vehicle
from tasks.registry.memory_at import memory_at
from tasks.servers.access import access, auth, auth_environment, check_address, hosts
from tasks.servers.guard import Guard
from tasks.servers.listening import address_of, bound, end_with_parent, serve_with
from tasks.servers.prefect_server import ENVIRONMENT
from tasks.settings.checks import checked_vehicle

_LOG = logging.getLogger(__name__)


def serve_memory(memory: str, vehicle: str, host: str, port: int, workers: int) -> None:
    """Serve until Ctrl-C or SIGTERM.

    Args:
        memory: the folder of a memory or of a library, the folder of a run with one memory, or a model in
            MLflow.
        vehicle: the vehicle's name or file.
        host: the address to listen on.
        port: the port; 0 takes any free one.
        workers: the number of worker processes.

    Raises:
        UsageError: the vehicle is unknown, or the address is malformed or not protected.
        RunError: the address cannot be used, or there is no such memory in MLflow.
        StorageError: the memory is missing, damaged, or made for another vehicle.
    """
    vehicle = checked_vehicle(vehicle)
    check_address(host)
    for name, value in (ENVIRONMENT | auth_environment()).items():
        os.environ.setdefault(name, value)
    with memory_at(memory) as folder, bound(host, port) as listener:
        archive = load_memory_or_library(folder, said_vehicle(vehicle))  # refused here, not by each worker

        def log_addresses() -> None:
            driven = name_of(archive.vehicle)
            plans = f"{len(archive.plans)} plans of class {archive.class_name}, {driven}"
            _LOG.info("memory   %s: %s", memory, plans)
            _LOG.info("serving  %s/invocations, workers: %d; Ctrl-C stops", address_of(listener), workers)
            _LOG.info("access   %s", access())

        serve_with(functools.partial(scoring_app, str(folder), vehicle), listener, workers, log_addresses)


def scoring_app(folder: str, vehicle: str) -> Guard:
    """The application of a worker, loaded, compiled and tried once; the worker ends with its parent."""
    end_with_parent()
    from tasks.serving.scoring import Scoring
    from tasks.tracking.memory_model import (  # late: imports MLflow and pandas
        MemoryModel,
        pyfunc_of,
    )

    model = MemoryModel()
    model.open(Path(folder), vehicle)
    scoring = Scoring(pyfunc_of(model))
    scoring.answer(sample_request(model.memory))
    return Guard(scoring, auth(), hosts())


def sample_request(memory: Memory | PlanLibrary) -> bytes:
    """A request that needs all kernels, in the memory's scale: a place, with a rotated start and a notched
    obstacle, and the pose at rest of a stored drive.
    """
    scale = memory.scales[0]
    notched = [[20.0, 40.0], [24.0, 40.0], [24.0, 44.0], [22.0, 41.0], [20.0, 44.0]]
    problem = {
        "start": [0.0, 0.0, math.pi / 4 + 0.05],  # room for trailers behind
        "goal": [50.5 * scale, 49.5 * scale],
        "goal_radius": 2.0 * scale,
        "bounds": [scale * bound for bound in (-7.0, -7.0, 57.0, 57.0)],
        "obstacles": [[[scale * x, scale * y] for x, y in notched]],
        "scale": scale,
    }
    library = memory if isinstance(memory, PlanLibrary) else memory.library
    pose = first_question(library, scale)
    asked = [problem] if pose is None else [problem, fields_of(pose, memory.vehicle)]
    return json.dumps({"dataframe_records": [{"problem": json.dumps(each)} for each in asked]}).encode()
