"""A data folder with a small run that was really made: a memory of six plans, attempts, recalls."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dashboards.report.tables import as_csv
from dashboards.statistics.panels import summarise
from dashboards.verdicts.drift import Usefulness, drifts
from dashboards.web.memory_versions import MemoryVersion
from planners.memory.memory import Memory
from planners.memory.plans.free import free_plans
from planners.solve import solve
from planners.world.arrays import Flags
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of, pack
from planners.world.problem import Problem
from storage.archives.memories import save_memory
from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.run_folder import RunFolder
from storage.tables.attempts import write_attempts
from storage.tables.hallucinated import write_hallucinated
from storage.tables.recalls import write_recalls
from storage.tables.watched import add_watched
from tasks.settings.run_settings import Assist
from tests.planners.memories import memory_of

CLASS = "trap"
PROBLEMS = 6
VERSIONS = (
    MemoryVersion("motion-memory-trap", 1, 0, "first", "rolled back", "", nan, nan, nan, "", False),
    MemoryVersion("motion-memory-trap", 2, 1, "second", "promoted", "1", 0.2, 0.1, 0.3, "sooner", True),
    MemoryVersion("motion-memory-trap", 3, 2, "gone", "refused", "2", -0.1, -0.2, 0.0, "not sooner", False),
)
SEEN = Usefulness(200, hits=160, mean_ms=1.5, median_ms=0.5, solved=200, total_s=21.0, total_sd_s=2.0)
WAYS = (
    Assist("none", 0), Assist("closed", 5, "exhaustive"), Assist("repair", 5, "exhaustive"),
    Assist("open", 1, "encoder"), Assist("none", 0, polished=True), Assist("repair", 5, "exhaustive", True),
)  # fmt: skip


def small_data(folder: Path, runs: Sequence[str] = ("first", "second")) -> DataFolder:
    """A data folder with runs of these names."""
    data = open_data_folder(folder)
    drawn = problem_class(CLASS)
    memory = replace(memory_of(drawn.draw(2, index) for index in range(6)), class_name=CLASS)
    unseen = [drawn.draw(3, index) for index in range(PROBLEMS)]
    for number, name in enumerate(runs):
        run = data.run(name)
        write_settings(run, experiences=len(memory.plans) + number)
        save_memory(run.memory(CLASS), memory)
        rows = attempt_rows(memory, unseen)
        write_attempts(run.shard("results", CLASS, 0), rows)
        run.summary("csv").write_text(as_csv(summarise(pd.DataFrame(rows), resamples=50)), "utf-8")
        _write_recalls(run, memory, unseen)
        _write_hallucinated(run, memory, [drawn.draw(4, index) for index in range(30)])
    for hits, total_s in ((160, 21.0), (150, 21.1), (90, 21.0), (160, 23.0)):
        now = replace(SEEN, hits=hits, total_s=total_s)
        seen = drifts("motion-memory-trap/2", {"gust closed 5": now}, {"gust closed 5": SEEN})
        add_watched(data.watched, [each.to_row() for each in seen])
    return data


def write_settings(run: RunFolder, **changes: Any) -> None:
    """What a run was asked for, and when its benchmark ran."""
    run.path.mkdir(parents=True, exist_ok=True)
    settings = {
        "preset": "smoke",
        "classes": [CLASS],
        "worlds": [],
        "planners": ["rrt", "gust"],
        "difficulty": "standard",
        "seed": 1,
        "objective": "labels",
        "experiences": 6,
        "test_problems": PROBLEMS,
        "vehicle": "car",
    }
    run.settings.write_text(json.dumps(settings | changes), "utf-8")
    stage = {
        "stage": "benchmark",
        "began": "2026-01-01T10:00:00+00:00",
        "seconds": 12.5,
        "host": "here",
        "commit": "c0ffee",
    }
    run.stages.write_text(json.dumps([stage]), "utf-8")


def attempt_rows(memory: Memory, problems: Sequence[Problem]) -> list[dict[str, Any]]:
    """Every planner in every way at every problem."""
    rows = []
    for problem in problems:
        for planner in ("rrt", "gust"):
            for assist, top_k, recall, polished in WAYS:
                known = None if assist == "none" else memory
                attempt = solve(
                    problem, planner, assist, max(top_k, 1), known, 1, strategy=recall, polished=polished
                )
                left_out = ("plan", "helped")
                fields = {name: value for name, value in vars(attempt).items() if name not in left_out}
                where = {
                    "memory": known and CLASS,
                    "run_id": None,
                    "commit": "c0ffee",
                    "host": "here",
                    "vehicle": "car",
                }
                rows.append(fields | where | {"recalled": list(attempt.recalled), "verified": True})
    return rows


def _labels(memory: Memory, problem: Problem) -> Flags:
    return free_plans(memory.sweeps, scene_of(problem))


def _write_recalls(run: RunFolder, memory: Memory, problems: Sequence[Problem]) -> None:
    rows = [
        {
            "problem_id": problem.id,
            "class": CLASS,
            "memory": CLASS,
            "protocol": "fresh",
            "order": np.arange(len(memory.plans)),
            "free": _labels(memory, problem),
            "nothing_recalled": False,
            "recall": "encoder",
            "training_seed": 0,
            "made_for": -1,
        }
        for problem in problems
    ]
    write_recalls(run.shard("recalls", CLASS, 0), rows, plans=len(memory.plans))


def _write_hallucinated(run: RunFolder, memory: Memory, problems: Sequence[Problem]) -> None:
    count = len(memory.plans)
    labels = np.array([_labels(memory, problem) for problem in problems])
    write_hallucinated(
        run.shard("hallucinated", CLASS, 0),
        problems,
        plan_index=np.arange(len(problems), dtype=np.int32) % (count + 1) - 1,
        methods=["drawn"] * len(problems),
        grids=np.array([pack(occupancy_of(problem)) for problem in problems]).reshape(len(problems), -1),
        labels=np.packbits(labels, axis=1),
        plans=count,
    )
