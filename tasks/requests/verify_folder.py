"""Check a data folder: files are complete, stored plans are free, repeated attempts end as before."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of, pack
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from planners.world.workspace import Workspace
from storage.archives.encoders import load_encoder
from storage.archives.hallucinators import load_hallucinator
from storage.archives.libraries import holds_plans
from storage.archives.memories import load_memory
from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.mirror import files_in, folders_in, is_there
from storage.places.run_folder import RunFolder, Table
from storage.tables.attempts import read_attempts
from storage.tables.experiences import read_experiences, vehicle_of_experiences
from storage.tables.gained_experiences import all_gained_shards, snapshots, sound_or_lost
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled
from storage.tables.recalls import read_recalls
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.attempt_rows import same_outcome
from tasks.attempts.judged_attempts import PlanFaultError, check_attempt, is_unaccepted
from tasks.inputs.problem_sources import held_back, source_of
from tasks.inputs.taught_experiences import taught_experiences
from tasks.requests.verify_plans import judged_stored_plans
from tasks.settings.errors import RunError, tell_faults
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import CHUNK_PROBLEMS
from tasks.stages.measure_recall import LONGEST_ORDER

LABELS_EVERY: Final = 50  # one hallucinated problem in this many has its grid and labels computed again
COLLECTED: Final[tuple[Table, ...]] = ("candidates", "learned", "curated", "experiences")

Findings = tuple[Counter[str], list[str]]  # counts of what was checked, and a line for each fault
Check = Callable[[], Findings]


def verify_folder(folder: Path, sample: float, workers: int) -> Counter[str]:
    """Check a whole data folder.

    Args:
        folder: the data folder.
        sample: the share of the attempted problems whose attempts are made again, 0 to 1.
        workers: the number of worker processes; one worker checks in this process.

    Returns:
        how many of each kind were checked.

    Raises:
        RunError: the folder holds no run, or something in it is wrong; the faults are logged.
    """
    data = open_data_folder(folder)
    checks = [check for run in data.runs() for check in _checks(data.place, run, sample)]
    for gained in data.gained_folders():
        own = [*all_gained_shards(gained), *snapshots(gained)]
        checks += [partial(_gained, path, VEHICLES.get(gained.name)) for path in own]
    checks += [partial(_answers, path) for path in files_in(data.judged_libraries, "[!.]*.parquet")]
    checks += [
        partial(_library, path)
        for path in ([] if data.is_remote else folders_in(data.libraries))  # there they are no folders
        if holds_plans(path)
    ]
    if not checks:
        raise RunError(f"{folder} does not hold a run or a library; make one with `motion-memory run`.")
    checked: Counter[str] = Counter()
    faults_found: list[str] = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(checks)), mp_context=context) as pool:
        for counts, new_faults in (pool.map if workers > 1 else map)(_run, checks):
            checked += counts
            faults_found += new_faults
    if faults_found:
        tell_faults(faults_found)
        raise RunError(
            f"{len(faults_found)} faults in {folder}; delete the files that are named, but for what was "
            "learned, and repeat the command that made them."
        )
    return checked


def _answers(path: Path) -> Findings:
    return Counter({"answers that libraries were judged by read": len(read_attempts(path))}), []


def _run(check: Check) -> Findings:
    try:
        return check()
    except (StorageError, PlanFaultError) as error:
        return Counter(), [str(error)]


def _checks(data: str, run: RunFolder, sample: float) -> Iterator[Check]:
    settings = recorded_settings(run)
    vehicle = said_vehicle(settings.vehicle)
    for name in settings.memory_names:
        shards = [path for table in COLLECTED for path in run.shards(table, name)]
        for path in (run.experiences(name), *shards):
            if is_there(path):
                yield partial(_experiences, path, vehicle)
        for path in run.shards("hallucinated", name):
            yield partial(_hallucinated, run, settings, name, path)
        if is_there(run.hallucinator(name)):
            yield partial(_hallucinator, run, name, vehicle)
        for path in run.shards("recalls", name):
            yield partial(_recalls, path)
        for seed in range(settings.learning.seeds):
            if is_there(run.model(name, seed)):
                yield partial(_encoder, run.model(name, seed), vehicle)
        if is_there(run.memory(name)):
            yield partial(_memory, run, name, vehicle)
        if is_there(run.champion(name)):
            yield partial(_champion, run, name, vehicle)
        for path in [*run.shards("results", name), *run.shards("judged", name)]:
            yield partial(_attempts, data, settings, run, name, path, sample)


def _experiences(path: Path, vehicle: Vehicle | None) -> Findings:
    vehicle = vehicle or vehicle_of_experiences(path)
    experiences = read_experiences(path, vehicle)
    wrong = [
        f"{path}: plan of {experience.problem.id}: {fault}"
        for experience in experiences
        for fault in faults(experience.problem, experience.plan, vehicle)
    ]
    return Counter({"plans of experiences re-simulated and checked by FCL": len(experiences)}), wrong


def _gained(path: Path, vehicle: Vehicle | None) -> Findings:
    with sound_or_lost(path):
        return _experiences(path, vehicle)


def _library(folder: Path) -> Findings:
    count, wrong = judged_stored_plans(folder)
    return Counter({"plans of libraries re-simulated, within their vehicle's limits": count}), wrong


def _hallucinated(run: RunFolder, settings: RunSettings, name: str, path: Path) -> Findings:
    problems, labelled = read_hallucinated_problems(path), read_labelled([path])
    free = labelled.free
    experiences = taught_experiences(run, settings, name)
    sweeps = sweep_plans([each.plan for each in experiences], said_vehicle(settings.vehicle))
    origin = labelled.plan_index  # [problems] the plan that each was made for, or negative
    rows = np.arange(len(origin))
    solved = (origin < 0) | free[rows, np.maximum(origin, 0)]
    wrong = [
        f"{path}: {problems[i].id} has a label that says the plan it was made for is not free"
        for i in rows[~solved]
    ]
    repeated = range(0, len(problems), LABELS_EVERY)
    for i in repeated:
        if (free_plans(sweeps, scene_of(problems[i])) != free[i]).any():
            wrong.append(f"{path}: {problems[i].id} has labels that do not fit its obstacles")
        if (pack(occupancy_of(problems[i])) != labelled.grids[i]).any():
            wrong.append(f"{path}: {problems[i].id} has a grid that does not fit its obstacles")
    counts = {
        "hallucinated problems read": len(problems),
        "of these, grids and labels computed again": len(repeated),
    }
    return Counter(counts), wrong


def _hallucinator(run: RunFolder, name: str, vehicle: Vehicle) -> Findings:
    load_hallucinator(run.hallucinator(name), vehicle)
    return Counter({"networks of learned hallucination read": 1}), []


def _recalls(path: Path) -> Findings:
    rows: list[dict[str, Any]] = _records(read_recalls([path]))
    wrong = [
        f"{path}: {row['problem_id']} ranks {len(row['order'])} of {len(row['free'])} plans, or one twice"
        for row in rows
        if len({*row["order"]} & {*range(len(row["free"]))}) != min(len(row["free"]), LONGEST_ORDER)
    ]
    return Counter({"recalls read": len(rows)}), wrong


def _encoder(folder: Path, vehicle: Vehicle) -> Findings:
    load_encoder(folder, vehicle)
    return Counter({"encoders read": 1}), []


def _memory(run: RunFolder, name: str, vehicle: Vehicle) -> Findings:
    memory = load_memory(run.memory(name), vehicle)
    plans = [experience.plan for experience in read_experiences(run.experiences(name), vehicle)]
    same = len(plans) == len(memory.plans) and all(
        np.array_equal(plan.states, stored.states) and np.array_equal(plan.controls, stored.controls)
        for plan, stored in zip(plans, memory.plans, strict=True)
    )
    wrong = [] if same else [f"{run.memory(name)}: its plans are not those of the experiences"]
    return Counter({"memories read": 1, "plans of memories compared with experiences": len(plans)}), wrong


def _champion(run: RunFolder, name: str, vehicle: Vehicle) -> Findings:
    load_memory(run.champion(name), vehicle)
    return Counter({"champions read": 1}), []


def _attempts(
    data: str, settings: RunSettings, run: RunFolder, name: str, path: Path, sample: float
) -> Findings:
    attempts_of_file = read_attempts(path)
    rows = _records(attempts_of_file)
    problem_source = held_back if path.is_relative_to(run.judged) else source_of
    source, vehicle = problem_source(data, settings, name), said_vehicle(settings.vehicle)
    solved = [row for row in rows if row["solved"]]
    unaccepted = attempts_of_file.loc[is_unaccepted(attempts_of_file), "problem_id"]
    wrong = [f"{path}: the authority did not accept a plan for {identity}" for identity in unaccepted]
    memories = {
        (name, run_id): load_memory(
            (run.memory if run_id == settings.run_name else run.champion)(name), vehicle
        )
        for name, run_id in {(row["memory"], row["run_id"]) for row in rows if row["memory"]}
    }
    attempts_repeated = plans_checked = 0
    workspace = Workspace()
    for position, (identity, attempts) in enumerate(groupby(rows, key=itemgetter("problem_id"))):
        if generator(settings.seed, "verify", identity).random() >= sample:
            continue
        problem = source.problem("test", int(path.stem) * CHUNK_PROBLEMS + position)
        if problem.id != identity:
            wrong.append(f"{path}: {identity} takes the place of {problem.id}")
            continue
        for row in attempts:
            memory = memories[row["memory"], row["run_id"]] if row["memory"] else None
            attempt = solve(
                problem,
                row["planner"],
                row["assist"],
                row["top_k"],
                memory,
                row["seed"],
                vehicle=vehicle,
                strategy=row["recall"],
                workspace=workspace,
                polished=row["polished"] is True,  # rows of earlier versions do not say so
            )
            attempt = check_attempt(problem, attempt, set(), vehicle)
            attempts_repeated += 1
            plans_checked += attempt.solved
            if not same_outcome(attempt, row, vehicle):
                wrong.append(f"{path}: {identity} by {row['planner']}, {row['assist']} now ends differently")
    return Counter(
        {
            "attempts read": len(rows),
            "plans of attempts checked by FCL when they were made": sum(
                bool(row["verified"]) for row in solved
            ),
            "attempts made again": attempts_repeated,
            "plans of these re-simulated and checked by FCL": plans_checked,
        }
    ), wrong


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows as dicts, with None instead of pandas' NaN."""
    return [
        {
            str(name): None if isinstance(value, float) and value != value else value
            for name, value in row.items()
        }
        for row in frame.to_dict("records")
    ]
