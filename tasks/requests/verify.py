"""The command ``verify``: check a data folder, or the plans of one memory or library by themselves."""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path
from typing import Final

from planners.world.authority.authority import faults
from planners.world.problem import GOAL_RADIUS, Plan, Problem, obstacles_of
from storage.archives.libraries import HEADERS, load_memory_or_library, vehicle_of
from storage.places.data_folder import MARK, open_data_folder
from storage.places.mirror import fetch, local_place
from tasks.servers.prefect_server import set_environment
from tasks.settings.errors import RunError, UsageError

_ROOM_M: Final = 1e6  # around a plan that is judged by itself
_MOST_FAULTS_TOLD: Final = 20
_LOG = logging.getLogger(__name__)


def verify(folder: Path, sample: float, workers: int) -> Counter[str]:
    """Check the files of a data folder, or of one memory or library.

    Args:
        folder: the data folder, or that of a memory or library.
        sample: share of the benchmark's problems that are attempted again, 0 to 1.
        workers: the number of worker processes.

    Returns:
        how many of each kind were checked.

    Raises:
        UsageError: the sample is not a share.
        RunError: the folder is not a data folder, a memory or a library, or it has a fault.
        StorageError: the memory or library is damaged.
    """
    if not 0.0 <= sample <= 1.0:
        raise UsageError(f"--sample is {sample}: give a share from 0 to 1.")
    if not fetch(local_place(folder) / MARK).is_file():
        if any((folder / header).is_file() for header in HEADERS):
            return _verify_plans(folder)
        raise RunError(f"{folder} is not a data folder (it has no {MARK}), and not a memory or library.")
    set_environment(open_data_folder(folder).path)
    from tasks.requests.verify_folder import verify_folder

    return verify_folder(folder, sample, workers)


def _verify_plans(folder: Path) -> Counter[str]:
    """Judge each plan of a memory or library: driven by its controls, within the limits of its vehicle.

    What was in the way is not stored with a plan, so nothing is said of that.
    """
    vehicle = vehicle_of(folder)
    stored = load_memory_or_library(folder, vehicle)
    wrong = [
        f"{folder}: plan {number}: {fault}"
        for number, plan in enumerate(stored.plans)
        for fault in faults(_by_itself(plan), plan, vehicle)
    ]
    if wrong:
        _LOG.error("\n".join(wrong[:_MOST_FAULTS_TOLD]))
        raise RunError(f"{len(wrong)} faults in {folder}; make it again.")
    return Counter({"plans re-simulated and judged by their vehicle's limits": len(stored.plans)})


def _by_itself(plan: Plan) -> Problem:
    """The problem that a plan answers where nothing is in its way."""
    x, y, heading, *motion = plan.states[0].tolist()
    goal = (float(plan.states[-1, 0]), float(plan.states[-1, 1]))
    bounds = (-_ROOM_M, -_ROOM_M, _ROOM_M, _ROOM_M)
    start = (x, y, heading)
    return Problem(
        "stored", "stored", start, goal, GOAL_RADIUS, bounds, obstacles_of([]), start_motion=tuple(motion)
    )
