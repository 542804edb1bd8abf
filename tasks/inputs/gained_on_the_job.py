"""Experiences gained on the job: new plans of `solve` and `plan`, kept for runs that ask for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from planners.attempt import Attempt
from planners.memory.plans.experience import Experience
from planners.world.problem import Problem, begins_straight, is_canonical
from planners.world.vehicles.vehicle import Vehicle
from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.mirror import local_place
from storage.places.run_folder import checked_name
from storage.tables.gained_experiences import add_gained, take_snapshot
from storage.vehicles.vehicle_files import label_of, said_vehicle
from tasks.settings.run_settings import RunSettings

NEW: Final = ("searched", "repaired")  # sources of plans that no memory had


class Solved(NamedTuple):
    """A problem in the canonical frame, and a checked attempt at it."""

    problem: Problem
    attempt: Attempt


def remember(data: Path, attempts: Sequence[Solved], vehicle: Vehicle) -> int:
    """Add the plans of canonical problems that no memory had to a data folder.

    Only problems that begin straight ahead: with one plan of another heading in it, a memory could not rank
    any by blocked cells.

    Args:
        data: the data folder.
        attempts: checked attempts of one planner.
        vehicle: who drives.

    Returns:
        how many plans were added.
    """
    new = [
        (Experience(problem, attempt.plan, vehicle), attempt)
        for problem, attempt in attempts
        if attempt.plan is not None
        and attempt.source in NEW
        and is_canonical(problem)
        and begins_straight(problem)
    ]
    if new:
        add_gained(
            open_data_folder(data).gained(label_of(vehicle)),
            [experience for experience, _ in new],
            planner=new[0][1].planner,
            seeds=[attempt.seed for _, attempt in new],
            planning_seconds=[attempt.planning_seconds for _, attempt in new],
            vehicle=vehicle,
        )
    return len(new)


def has_gained(data: Path) -> bool:
    """Whether a data folder holds plans gained on the job."""
    return bool(DataFolder(local_place(data)).gained_folders())


def with_gained(settings: RunSettings, data: Path, name: str) -> RunSettings:
    """The settings with a snapshot of experiences gained on the job, as additional candidates.

    Args:
        settings: those of the run.
        data: the data folder.
        name: name of the snapshot, which is taken when the name is first used.

    Raises:
        StorageError: nothing was learned for the vehicle.
    """
    folder = open_data_folder(data).gained(settings.vehicle_label)
    snapshot = take_snapshot(folder, checked_name(name), said_vehicle(settings.vehicle))
    return replace(settings, learned=snapshot)
