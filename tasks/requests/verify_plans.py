"""Judge the plans of a memory or library, and those in files as ``plan``, ``solve`` and ``route`` write."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from planners.world.authority.authority import faults
from planners.world.problem import GOAL_RADIUS, Plan, Problem, obstacles_of
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.libraries import load_memory_or_library, vehicle_of
from storage.exchange.plans import PlanRecord, is_plan_file, read_plan
from storage.exchange.problems import problems_or_faults
from tasks.fan_out.progress import progress
from tasks.settings.errors import RunError, tell_faults

_ROOM_M: Final = 1e6  # around a plan that is judged by itself
_BY_ITSELF: Final = "plans driven again by their controls, within their vehicle's limits"
_IN_PROBLEM: Final = "plans driven again by their controls, from start to goal of their problems, and swept"
_NO_PLAN: Final = "files that hold no plan, but say why there is none"

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
    vehicle = vehicle_of(folder)
    stored = load_memory_or_library(folder, vehicle)
    wrong = [
        f"{folder}: plan {number}: {fault}"
        for number, plan in enumerate(stored.plans)
        for fault in faults(_by_itself(plan), plan, vehicle)
    ]
    _refuse(wrong, f" in {folder}; make it again")
    return Counter({_BY_ITSELF: len(stored.plans)})


def plan_files_in(path: Path) -> list[Path]:
    """The files of plans at ``path``, a file or a folder with such files at any depth; sorted."""
    if path.is_dir():
        return [file for file in sorted(path.rglob("*.json")) if is_plan_file(file)]
    return [path] if path.suffix == ".json" and path.is_file() else []


def verify_plan_files(files: Sequence[Path], problems: Path | None) -> Counter[str]:
    """Judge each plan of files in its problem, or by itself.

    Args:
        files: of plans, at least one, all for the same vehicle.
        problems: a file with the problem of each plan, found by its id; a single problem may have any id, if
            there is a single plan. None judges each plan by itself: no obstacles, no goal.

    Returns:
        how many plans were judged, and how many files hold none.

    Raises:
        RunError: a plan is faulty, or its problem is not there; the faults are logged.
        StorageError: a file is malformed, or of another vehicle.
    """
    vehicle = read_plan(files[0]).vehicle
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    with progress("verify", len(files), end_is_told=False) as show:
        asked = _each_by_itself(files, vehicle) if problems is None else _each_in(files, problems, vehicle)
        for done, (file, record, problem) in enumerate(asked, start=1):
            plan = record.plan if isinstance(problem, str) else record.plan_in_frame_of(problem)
            if plan is None:
                counts[_NO_PLAN] += 1
            elif isinstance(problem, str):
                wrong.append(f"{file}: {problem}")
            else:
                wrong += [f"{file}: {fault}" for fault in faults(problem, plan, vehicle)]
                counts[_BY_ITSELF if problems is None else _IN_PROBLEM] += 1
            show(done)
    _refuse(wrong, "; see above")
    if problems is None:
        _LOG.info("Obstacles and goals were not looked at: name the file of the problems with --problems.")
    return counts


_Asked = Iterator[tuple[Path, PlanRecord, Problem | str]]  # a plan's file, what it holds, and its problem,
# or why its problem cannot be had


def _each_by_itself(files: Sequence[Path], vehicle: Vehicle) -> _Asked:
    for file in files:
        record = read_plan(file, vehicle)
        here: Problem | str = "holds no plan"
        if record.plan is not None:
            here = replace(_by_itself(record.plan), scale=record.scale, offset=record.offset)
        yield file, record, here


def _each_in(files: Sequence[Path], problems: Path, vehicle: Vehicle) -> _Asked:
    """The plans in the order of their problems, then those that have none."""
    left = {read_plan(file, vehicle).problem_id: file for file in files}
    read = malformed = 0
    why, only = "", None
    for where, problem in problems_or_faults(problems, vehicle):
        read += 1
        if isinstance(problem, str):
            malformed += 1
            why = why or f"; {where}: {problem}"
            continue
        only = problem
        if problem.id in left:
            yield _paired(left.pop(problem.id), problem, vehicle)
    if read == 1 and only is not None and len(left) == len(files) == 1:
        ((made_for, file),) = left.items()
        _LOG.warning("%s was made for problem %s; it is judged in problem %s", file, made_for, only.id)
        yield _paired(file, only, vehicle)
        return
    for made_for, file in left.items():
        yield file, read_plan(file, vehicle), f"{problems} holds no sound problem {made_for!r}{why}"


def _paired(file: Path, problem: Problem, vehicle: Vehicle) -> tuple[Path, PlanRecord, Problem | str]:
    record = read_plan(file, vehicle)
    if record.plan is not None and record.scale != problem.scale:
        return file, record, f"its scale is {record.scale:g}, that of its problem {problem.scale:g}"
    return file, record, problem


def _by_itself(plan: Plan) -> Problem:
    """The problem that a plan answers where nothing is in its way."""
    x, y, heading, *motion = plan.states[0].tolist()
    goal = (float(plan.states[-1, 0]), float(plan.states[-1, 1]))
    bounds = (x - _ROOM_M, y - _ROOM_M, x + _ROOM_M, y + _ROOM_M)
    start = (x, y, heading)
    return Problem(
        "stored", "stored", start, goal, GOAL_RADIUS, bounds, obstacles_of([]), start_motion=tuple(motion)
    )


def _refuse(wrong: Sequence[str], what_now: str) -> None:
    if wrong:
        tell_faults(wrong)
        raise RunError(f"{len(wrong)} fault{'s' * (len(wrong) > 1)}{what_now}.")
