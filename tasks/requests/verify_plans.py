"""Judge the plans of a memory or library, and those in files as ``plan``, ``solve`` and ``route`` write."""

from __future__ import annotations

import logging
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.libraries import load_memory_or_library, vehicle_of
from storage.errors import StorageError
from storage.exchange.plans import PlanRecord, read_plan
from storage.exchange.problems import problems_or_faults
from storage.fields import short
from storage.places.files import read_json
from tasks.fan_out.progress import progress
from tasks.requests.map_plans import MapJudge, by_itself
from tasks.settings.errors import RunError, tell_faults

_BY_ITSELF: Final = "plans driven again by their controls, within their vehicle's limits"
_ON_MAP: Final = "plans driven again by their controls, and swept over the map"
_IN_PROBLEM: Final = "plans driven again by their controls, from start to goal of their problems, and swept"
_NO_GOALS: Final = "Goals were not looked at: files of routes do not say where these were to lead."
_LOOKED_AT_LESS: Final = (
    "Obstacles and goals were not looked at: for plans of problems, name the file of these with --problems, "
    "for routes their map with --map."
)
NO_PLAN: Final = "files that hold no plan, but say why there is none"

_LOG = logging.getLogger(__name__)


def verify_stored_plans(folder: Path) -> Counter[str]:
    """Judge each plan of a memory or library by itself: what was in its way is not stored with it.

    Args:
        folder: that of the memory or library.

    Returns:
        how many plans were judged.

    Raises:
        RunError: a plan is faulty; the faults are logged.
        StorageError: the memory or library is damaged.
    """
    count, wrong = judged_stored_plans(folder)
    _refuse(wrong, f" in {folder}; make it again")
    return Counter({_BY_ITSELF: count})


def judged_stored_plans(folder: Path) -> tuple[int, list[str]]:
    """How many plans the memory or library in a folder holds, and a line for each fault of one.

    Raises StorageError if it is damaged.
    """
    vehicle = vehicle_of(folder)
    stored = load_memory_or_library(folder, vehicle)
    return len(stored.plans), [
        f"{folder}: plan {number}: {fault}"
        for number, plan in enumerate(stored.plans)
        for fault in faults(by_itself(plan), plan, vehicle)
    ]


def verify_plan_files(path: Path, problems: Path | None, on_map: MapJudge | None = None) -> Counter[str]:
    """Judge each plan of a file, or of the files in a folder, in its problem, on a map or by itself.

    Args:
        path: a plan's file, or a folder with such files at any depth. Damaged JSON files in a folder are
            faults, since they may have been plans; files that hold something else are left alone.
        problems: a file with the problem of each plan, found by its id; a single problem may have any id, if
            there is a single plan. None judges each plan by itself: no obstacles, no goal.
        on_map: judges each plan on a map; None if there is none, or if there are problems.

    Returns:
        how many plans were judged, and how many files hold none; nothing if there are no such files.

    Raises:
        RunError: a plan is faulty, its problem is not there, or a file in the folder is malformed; the faults
            are logged.
        StorageError: the file of the plan or of the problems is missing or malformed.
    """
    is_folder = path.is_dir()
    wrong: list[str] = []
    others: list[str] = []
    of_vehicles: defaultdict[Vehicle, dict[str, list[Path]]] = defaultdict(dict)
    files = sorted(path.rglob("*.json")) if is_folder else [path] if path.suffix == ".json" else []
    for file in files:
        try:
            record = read_plan(file)
        except StorageError as error:
            if not is_folder:
                raise
            if _holds_something_else(file):
                others.append(str(file))
            else:
                wrong.append(str(error))
        else:
            of_vehicles[record.vehicle].setdefault(record.problem_id, []).append(file)
    count = len(files) - len(others)
    if count == 0:
        return Counter()
    if others:
        _LOG.warning("Left alone, since no plan is in them: %s", short(others))
    counts: Counter[str] = Counter()
    judged = _ON_MAP if on_map is not None else _BY_ITSELF if problems is None else _IN_PROBLEM
    done = 0
    with progress("verify", count, end_is_told=False) as show:
        for vehicle, by_id in of_vehicles.items():
            for file, problem in _with_problems(by_id, problems, vehicle):
                record = read_plan(file)
                if record.plan is None:
                    counts[NO_PLAN] += 1
                else:
                    counts[judged] += 1
                    found = (
                        on_map.faults(record, record.plan)
                        if on_map is not None
                        else _faults(record, record.plan, problem)
                    )
                    wrong += [f"{file}: {fault}" for fault in found]
                done += 1
                show(done)
    _refuse(wrong, f" in {count} files of plans")
    if judged != _IN_PROBLEM:
        _LOG.info(_LOOKED_AT_LESS if judged == _BY_ITSELF else _NO_GOALS)
    return counts


def _holds_something_else(file: Path) -> bool:
    try:
        fields = read_json(file)
    except StorageError:
        return False
    return not (isinstance(fields, dict) and "states" in fields)


def _with_problems(
    by_id: dict[str, list[Path]], problems: Path | None, vehicle: Vehicle
) -> Iterator[tuple[Path, Problem | str | None]]:
    """Each plan's file with its problem, or why its problem cannot be had, or None if none is asked for.

    ``by_id`` has the files by the id of their problem. They come in the order of the problems.
    """
    if problems is None:
        yield from ((file, None) for files in by_id.values() for file in files)
        return
    left = dict(by_id)
    malformed: list[str] = []
    sound = 0
    for where, problem in problems_or_faults(problems, vehicle):
        if isinstance(problem, str):
            malformed.append(f"{where}: {problem}")
            continue
        sound += 1
        for file in left.pop(problem.id, ()):
            yield file, problem
        only = problem
    if sound == 1 and not malformed and [len(files) for files in left.values()] == [1] == [len(by_id)]:
        ((made_for, (file,)),) = left.items()
        _LOG.warning("%s was made for problem %s; it is judged in problem %s", file, made_for, only.id)
        yield file, only
        return
    for made_for, files in by_id.items():
        told = [each for each in malformed if f"(id {short(made_for)})" in each]
        if not sound and len(malformed) == 1:  # nothing else can be meant
            told = malformed
        if told or made_for in left:
            why = told[0] if told else f"{problems} has no problem with the id {made_for}"
            yield from ((file, why) for file in files)


def _faults(record: PlanRecord, plan: Plan, problem: Problem | str | None) -> list[str]:
    """What is wrong with the ``plan`` of a ``record``; arguments as of ``_with_problems``."""
    if problem is None:
        alone = replace(by_itself(plan), scale=record.scale, offset=record.offset)
        return faults(alone, plan, record.vehicle)
    if isinstance(problem, str):
        return [problem]
    if record.scale != problem.scale:
        return [f"Scale: it is {record.scale:g}, that of the problem {problem.scale:g}."]
    return faults(problem, record.plan_from(problem.offset) or plan, record.vehicle)


def _refuse(wrong: Sequence[str], where: str) -> None:
    if len(wrong) == 1:
        raise RunError(wrong[0])
    if wrong:
        tell_faults(wrong)
        raise RunError(f"{len(wrong)} faults{where}.")
