"""Experiences gained on the job: new plans of `solve` and `plan`, kept for runs and libraries."""

from __future__ import annotations

import hashlib
import logging
import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from planners.attempt import NEW, Attempt
from planners.memory.plans.experience import Experience
from planners.world.problem import Arrival, Problem, begins_straight, is_canonical
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import InUseError, StorageError, ended
from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.mirror import local_place, remove
from storage.places.run_folder import checked_name
from storage.tables.gained_experiences import add_gained, gained_shards, snapshot_path, take_snapshot
from storage.vehicles.vehicle_files import label_of, said_vehicle
from tasks.settings.run_settings import RunSettings

NAMELESS: Final = ("", "problem")  # ids of problems that were given none
DIGITS: Final = 12  # of a question's digest, in its id

_LOG: Final = logging.getLogger(__name__)


class Solved(NamedTuple):
    """A problem in the canonical frame, and a checked attempt at it."""

    problem: Problem
    attempt: Attempt


def remember(data: Path, attempts: Sequence[Solved], vehicle: Vehicle) -> int:
    """Add the plans that no memory had to a data folder.

    Straight problems are kept for the memories of runs: from rest to a place 50√2 m straight ahead. With one
    plan of another heading in it, such a memory could not rank any by blocked cells. All others are general
    questions, kept for libraries; of these a repaired plan is a stored one that was moved, and nothing new.

    Args:
        data: the data folder.
        attempts: checked attempts.
        vehicle: who drives.

    Returns:
        how many plans no memory had; of one that is there already nothing more is kept.

    Raises:
        StorageError: some cannot be written, or there are many shards and one of them is damaged.
    """
    straight: list[tuple[Experience, Attempt]] = []
    questions: list[tuple[Experience, Attempt]] = []
    for problem, attempt in attempts:
        if attempt.plan is None or attempt.source not in NEW:
            continue
        # its own id may come again: straight ones are left out of tests by theirs, unless they have none
        named = replace(problem, id=f"{problem.class_name}-{question_digest(problem)[:DIGITS]}")
        if is_canonical(problem) and begins_straight(problem):
            kept = named if problem.id in NAMELESS else problem
            straight.append((Experience(kept, attempt.plan, vehicle), attempt))
        elif attempt.source == "searched":
            questions.append((Experience(named, attempt.plan, vehicle), attempt))
    label = label_of(vehicle)
    folder = open_data_folder(data)
    with ExitStack() as stack:  # neither is kept from being learned by what befalls the other
        for place, new in ((folder.gained_questions(label), questions), (folder.gained(label), straight)):
            if new:
                stack.callback(
                    add_gained,
                    place,
                    [experience for experience, _ in new],
                    planners=[attempt.planner for _, attempt in new],
                    seeds=[attempt.seed for _, attempt in new],
                    planning_seconds=[attempt.planning_seconds for _, attempt in new],
                    vehicle=vehicle,
                )
    return len(straight) + len(questions)


def remember_or_warn(data: Path | None, attempts: Sequence[Solved], vehicle: Vehicle) -> int | None:
    """Keep what can be learned of attempts whose answer stands whether that works or not.

    Like ``remember``, but if nothing can be kept it warns and returns None. Without a data folder it keeps
    nothing and returns 0.
    """
    if data is None:
        return 0
    try:
        return remember(data, attempts, vehicle)
    except (StorageError, OSError) as error:
        _LOG.warning("The plan is there, but nothing is learned of it: %s", ended(str(error)))
        return None


def question_digest(question: Problem) -> str:
    """A digest of what a question in the canonical frame asks, whatever it is called."""
    arrival = question.arrival or Arrival()
    motion = np.trim_zeros(np.array(question.start_motion, float), "b")
    heading = math.nan if arrival.heading is None else arrival.heading
    numbers = (
        *((*question.start, *question.goal, question.goal_radius, *question.bounds, question.scale),),
        motion,
        (heading, arrival.heading_tolerance, arrival.least_speed, arrival.most_speed),
        *(arrival.hitches, arrival.hitch_tolerances),
        question.obstacles.vertices.ravel(),
        *(question.obstacles.piece_starts, question.obstacles.obstacle_starts),
    )
    digest = hashlib.sha256()
    for each in numbers:
        digest.update(np.array([len(each), *each], np.float64).tobytes())
    return digest.hexdigest()


def snapshot_of_questions(data: Path | str, vehicle: Vehicle, name: str) -> Path:
    """The file of a snapshot of the general questions that a vehicle answered on the job.

    Args:
        data: the data folder.
        vehicle: who drives.
        name: name of the snapshot, which is taken when the name is first used.

    Raises:
        StorageError: none was learned for the vehicle.
    """
    folder = open_data_folder(data).gained_questions(label_of(vehicle))
    if not gained_shards(folder):
        raise StorageError(
            f"{data} holds no questions that {label_of(vehicle)} has learned; solve problems with --learn "
            "first, or name the vehicle that did."
        )
    return snapshot_path(folder, take_snapshot(folder, name, vehicle))


@contextmanager
def removed_if_it_fails(snapshot: Path) -> Iterator[None]:
    """Remove a snapshot if the work with it raises an error: the next try is with what was learned by then.

    Work that is killed or interrupted leaves it, so that the same command goes on with it. So does work that
    is refused because another command does it: that one reads the snapshot.

    Args:
        snapshot: the file of a snapshot that nothing rests on yet.
    """
    try:
        yield
    except InUseError:
        raise
    except Exception:
        remove(snapshot)
        raise


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
