"""Verify: shards and archives are whole, stored plans are good, and attempts come out the same again."""

from __future__ import annotations

import multiprocessing
import sys
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

from planners.memory.plans.fit import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of, pack
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES, Vehicle, vehicle_named
from planners.world.workspace import Workspace
from storage.archives.encoders import load_encoder
from storage.archives.hallucinators import load_hallucinator
from storage.archives.memories import load_memory
from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.mirror import is_there
from storage.places.run_folder import RunFolder, Table
from storage.tables.attempts import read_attempts
from storage.tables.experiences import read_experiences
from storage.tables.gained_experiences import gained_shards
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled
from storage.tables.recalls import read_recalls
from tasks.attempts.attempt_rows import PlanFaultError, check_attempt, same_outcome
from tasks.inputs.problem_sources import held_back, source_of
from tasks.inputs.taught_experiences import taught_experiences
from tasks.settings.errors import RunError
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import CHUNK_PROBLEMS
from tasks.stages.measure_recall import LONGEST_ORDER

LABELS_EVERY: Final = 50  # hallucinated problems whose grid and labels are drawn again
COLLECTED: Final[tuple[Table, ...]] = ("candidates", "curated", "experiences")
SHOWN: Final = 20  # faults listed

Findings = tuple[Counter[str], list[str]]  # what was checked, and what is wrong
Job = Callable[[], Findings]


def verify_folder(folder: Path, sample: float, workers: int) -> None:
    """Check a whole data folder and print what was checked; RunError when something is wrong."""
    data = open_data_folder(folder)
    jobs = [job for run in data.runs() for job in _jobs(data.place, run, sample)]
    for name, vehicle in VEHICLES.items():
        jobs += [partial(_experiences, path, vehicle) for path in gained_shards(data.gained(name))]
    if not jobs:
        raise RunError(f"{folder} holds no run; make one with `motion-memory run`.")
    checked: Counter[str] = Counter()
    wrong: list[str] = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(jobs)), mp_context=context) as pool:
        for counts, found in pool.map(_do, jobs):
            checked += counts
            wrong += found
    for what, count in checked.items():
        print(f"{count:9,} {what}")
    if wrong:
        print(*wrong[:SHOWN], sep="\n", file=sys.stderr)
        raise RunError(
            f"{len(wrong)} faults in {folder}; delete what is named and run the same command again."
        )
    print("No fault found.")


def _do(job: Job) -> Findings:
    try:
        return job()
    except (StorageError, PlanFaultError) as error:
        return Counter(), [str(error)]


def _jobs(data: str, run: RunFolder, sample: float) -> Iterator[Job]:
    settings = recorded_settings(run)
    vehicle = vehicle_named(settings.vehicle)
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


def _experiences(path: Path, vehicle: Vehicle) -> Findings:
    experiences = read_experiences(path, vehicle)
    wrong = [
        f"{path}: plan of {experience.problem.id}: {fault}"
        for experience in experiences
        for fault in faults(experience.problem, experience.plan, vehicle)
    ]
    return Counter({"plans of experiences re-simulated and checked by FCL": len(experiences)}), wrong


def _hallucinated(run: RunFolder, settings: RunSettings, name: str, path: Path) -> Findings:
    problems, labelled = read_hallucinated_problems(path), read_labelled([path])
    free = labelled.free
    experiences = taught_experiences(run, settings, name)
    sweeps = sweep_plans([each.plan for each in experiences], vehicle_named(settings.vehicle))
    made_for = labelled.plan_index
    rows = np.arange(len(made_for))
    solved = (made_for < 0) | free[rows, np.maximum(made_for, 0)]
    wrong = [f"{path}: {problems[i].id} has a label that denies what it was made for" for i in rows[~solved]]
    again = range(0, len(problems), LABELS_EVERY)
    for i in again:
        if (free_plans(sweeps, scene_of(problems[i])) != free[i]).any():
            wrong.append(f"{path}: {problems[i].id} has other labels than its obstacles say")
        if (pack(occupancy_of(problems[i])) != labelled.grids[i]).any():
            wrong.append(f"{path}: {problems[i].id} has another grid than its obstacles say")
    read = {"hallucinated problems read": len(problems), "of these, grids and labels drawn again": len(again)}
    return Counter(read), wrong


def _hallucinator(run: RunFolder, name: str, vehicle: Vehicle) -> Findings:
    load_hallucinator(run.hallucinator(name), vehicle)
    return Counter({"networks of learned hallucination read": 1}), []


def _recalls(path: Path) -> Findings:
    rows: list[dict[str, Any]] = _records(read_recalls([path]))
    wrong = [
        f"{path}: {row['problem_id']} ranks {len(row['order'])} of {len(row['free'])} plans, or some twice"
        for row in rows
        if len({*row["order"]} & {*range(len(row["free"]))}) != min(len(row["free"]), LONGEST_ORDER)
    ]
    return Counter({"recalls read": len(rows)}), wrong


def _encoder(folder: Path, vehicle: Vehicle) -> Findings:
    load_encoder(folder, vehicle)
    return Counter({"encoders read": 1}), []


def _memory(run: RunFolder, name: str, vehicle: Vehicle) -> Findings:
    memory = load_memory(run.memory(name), vehicle)
    kept = [experience.plan for experience in read_experiences(run.experiences(name), vehicle)]
    same = len(kept) == len(memory.plans) and all(
        np.array_equal(ours.states, theirs.states) and np.array_equal(ours.controls, theirs.controls)
        for ours, theirs in zip(kept, memory.plans, strict=True)
    )
    wrong = [] if same else [f"{run.memory(name)}: its plans are not those of the experiences"]
    return Counter({"memories read": 1, "plans of memories compared with experiences": len(kept)}), wrong


def _champion(run: RunFolder, name: str, vehicle: Vehicle) -> Findings:
    load_memory(run.champion(name), vehicle)
    return Counter({"champions read": 1}), []


def _attempts(
    data: str, settings: RunSettings, run: RunFolder, name: str, path: Path, sample: float
) -> Findings:
    rows = _records(read_attempts(path))
    drawn = held_back if path.is_relative_to(run.judged) else source_of
    source, vehicle = drawn(data, settings, name), vehicle_named(settings.vehicle)
    solved = [row for row in rows if row["solved"]]
    wrong = [
        f"{path}: a plan for {row['problem_id']} was never checked" for row in solved if not row["verified"]
    ]
    memories = {
        (name, made): load_memory((run.memory if made == settings.run_name else run.champion)(name), vehicle)
        for name, made in {(row["memory"], row["run_id"]) for row in rows if row["memory"]}
    }
    again = plans = 0
    workspace = Workspace()
    for place, (identity, attempts) in enumerate(groupby(rows, key=itemgetter("problem_id"))):
        if generator(settings.seed, "verify", identity).random() >= sample:
            continue
        problem = source.problem("test", int(path.stem) * CHUNK_PROBLEMS + place)
        if problem.id != identity:
            wrong.append(f"{path}: {identity} is not where it should be, {problem.id} is")
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
            )
            check_attempt(problem, attempt, set(), vehicle)
            again += 1
            plans += attempt.solved
            if not same_outcome(attempt, row, vehicle):
                wrong.append(f"{path}: {identity} by {row['planner']}, {row['assist']} comes out otherwise")
    return Counter(
        {
            "attempts read": len(rows),
            "plans of attempts checked by FCL when they were made": len(solved),
            "attempts made again": again,
            "plans of these re-simulated and checked by FCL": plans,
        }
    ), wrong


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows with None where pandas has its NaN."""
    return [
        {
            str(name): None if isinstance(value, float) and value != value else value
            for name, value in row.items()
        }
        for row in frame.to_dict("records")
    ]
