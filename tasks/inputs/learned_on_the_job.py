"""Learning on the job: what `solve` and `plan` found anew, kept for the next run that asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from planners.memory.plans.experience import Experience
from planners.solve import Attempt
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle, name_of, vehicle_named
from storage.places.data_folder import open_data_folder
from storage.places.run_folder import checked_name
from storage.tables.learned_experiences import add_learned, take_snapshot
from tasks.settings.run_settings import RunSettings

NEW: Final = ("searched", "repaired")  # sources of plans that no memory had


class Solved(NamedTuple):
    """A problem in the canonical frame, and a checked attempt at it."""

    problem: Problem
    attempt: Attempt


def remember(data: Path, found: Sequence[Solved], vehicle: Vehicle) -> int:
    """Add what is new among checked attempts of one planner to a data folder; how many those are."""
    new = [
        (Experience(problem, attempt.plan, vehicle), attempt)
        for problem, attempt in found
        if attempt.plan is not None and attempt.source in NEW
    ]
    if new:
        add_learned(
            open_data_folder(data).learned(name_of(vehicle)),
            [experience for experience, _ in new],
            planner=new[0][1].planner,
            seeds=[attempt.seed for _, attempt in new],
            planning_seconds=[attempt.planning_seconds for _, attempt in new],
            vehicle=vehicle,
        )
    return len(new)


def with_learned(settings: RunSettings, data: Path, name: str) -> RunSettings:
    """Settings with what the data folder has learned as further candidates: its snapshot ``name``.

    The snapshot is taken when its name is first used. StorageError: nothing was learned for the vehicle.
    """
    folder = open_data_folder(data).learned(settings.vehicle)
    called = take_snapshot(folder, checked_name(name), vehicle_named(settings.vehicle))
    return replace(settings, learned=called)
