"""Retraining in this process, without Prefect and Dask: what ``flows.retrain`` does, chunk by chunk."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from planners.attempt import Attempt
from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.vehicles.vehicle import CAR
from storage.places.data_folder import open_data_folder
from tasks.champions.conclude import conclude
from tasks.champions.new_experience import runs_to_make
from tasks.inputs.gained_on_the_job import Solved, remember
from tasks.registry.champion_registry import Registry
from tasks.reports.report import report_retrieval
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import Assist, RunSettings
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.hallucinate import HALLUCINATE
from tasks.stages.judge import CHECK_PLANS, JUDGE
from tasks.stages.measure_recall import MEASURE_RECALL
from tasks.stages.train import TRAIN
from tasks.tracking.logbook import log_memories, log_training, run_logged
from tests.tasks.in_process import collect, run_stage

CLASS: Final = "curves"
SETTINGS: Final = replace(
    for_preset("smoke", classes=[CLASS], seed=3, planners=["gust"]),
    experiences=8,
    candidates=8,  # so that the first champion is no good choice, and learning pays
    problems_per_experience=40,
    test_problems=50,
    epochs=4,
    assists=(Assist("closed", 5), Assist("closed", 1, "encoder")),
    continual="none",
)


def make(data: str, settings: RunSettings) -> None:
    """Every stage of a run up to what a judgement needs."""
    collect(data, settings)
    run_stage(HALLUCINATE, data, settings)
    log_training(data, settings, run_stage(TRAIN, data, settings))
    memories = run_stage(BUILD_MEMORY, data, settings)
    run_stage(MEASURE_RECALL, data, settings)
    log_memories(data, settings, memories, report_retrieval(data, settings))
    run_stage(CHECK_PLANS, data, settings)
    for chunk in JUDGE.chunks(data, settings):
        if not JUDGE.is_written(chunk):
            JUDGE.run(chunk)


def retrain(data: str, settings: RunSettings = SETTINGS, approve: bool = False) -> list[RunSettings]:
    """Retrain once; the settings of the runs that were made."""
    folder = open_data_folder(data)
    registry = Registry(folder)
    made = runs_to_make(folder, settings, registry)
    for each in made:
        with run_logged(data, each.settings):
            make(data, each.settings)
            conclude(data, each, registry, approve)
    return [each.settings for each in made]


def timed_by_work(*asked: Any, **named: Any) -> Attempt:
    """An attempt whose time is what it did: a busy machine's clock would decide who is champion.

    The machine is so slow that a search takes as long as a drive, so few problems show who is sooner.
    """
    attempt = solve(*asked, **named)
    return replace(attempt, planning_seconds=1e-2 * (10 + attempt.collision_checks))


def learn(data: str, seed: int, count: int) -> None:
    """Solve problems of the class on the job."""
    problems = [problem_class(CLASS).draw(seed, index) for index in range(count)]
    remember(open_data_folder(data).path, [Solved(each, solve(each, "follow")) for each in problems], CAR)
