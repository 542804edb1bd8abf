"""How often the first of 100 plans is free, or one of five: by the encoder, by cells, by controls."""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from planners.memory.build_memory import build_memory
from planners.memory.encoder.training import TrainingSettings, train
from planners.memory.labelling import label_problems
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of, rank_by_cells
from planners.memory.plans.sweeps import sweep_plans
from planners.memory.recall import rank
from planners.world.arrays import Flags, Integers
from planners.world.geometry.occupancy import bits_of, unpack
from planners.world.problem import Problem
from planners.world.randomness import generator
from tests.trials.encoder_and_mask.worlds import Lesson, lesson_of, problems_of, worlds_for

SEEDS: Final = (0, 1, 2)  # of trainings
EPOCHS: Final = 8
PROBLEMS: Final = 1_000  # a world, at most
TOP: Final = 5
CHANGE_M: Final = 0.5  # standard deviation by which each corner of an obstacle moves in a small change


def taught(memory: str, lesson: Lesson, seed: int) -> Memory:
    """The memory of a lesson with the encoder of one training."""
    masks = masks_of(sweep_plans(lesson.plans))
    settings = TrainingSettings(epochs=EPOCHS, seed=seed)
    trained = train(lesson.grids, lesson.made_for, lesson.free, masks, settings)
    return build_memory(trained, lesson.plans, memory)


def measured(memory: str) -> list[dict[str, Any]]:
    """A row a world: which of the first plans of each ranking are free, a list of problems each."""
    lesson = lesson_of(memory)
    memories = [taught(memory, lesson, seed) for seed in SEEDS]
    return [on_world(memory, memories, lesson, world) for world in worlds_for(memory)]


def on_world(memory: str, memories: list[Memory], lesson: Lesson, world: str) -> dict[str, Any]:
    """Rank the plans of a memory for the problems of a world, in each way."""
    problems = problems_of(world, PROBLEMS)
    grids, free = label_problems(problems, memories[0].sweeps)
    changed = label_problems([slightly_changed(problem) for problem in problems], memories[0].sweeps).free
    orders = orders_of(memories, lesson.free, grids)
    rows: dict[str, Any] = {"memory": memory, "world": world, "problems": len(problems)}
    rows["oracle"] = free.any(1).tolist()
    for way, order in orders.items():
        for name, truth in (("first", free), ("changed", changed)):
            hits = np.take_along_axis(truth, order[:, :1].astype(np.int64), 1)[:, 0]
            rows[f"{way} {name}"] = hits.tolist()
        rows[f"{way} five"] = np.take_along_axis(free, order.astype(np.int64), 1).any(1).tolist()
    return rows


def orders_of(memories: list[Memory], learned: Flags, grids: Any) -> dict[str, Integers]:
    """The first plans ``[n, TOP]`` of each ranking, for packed grids ``[n, 512]``."""
    popular = np.argsort(-learned.mean(0), kind="stable")[:TOP].astype(np.int32)
    bits = [bits_of(unpack(grid)) for grid in grids]
    count = len(memories[0].plans)
    orders = {
        "mask": [rank_by_cells(memories[0].masks, each).order[:TOP] for each in bits],
        "popularity": [popular for _ in bits],
        "blind": [generator(0, "blind", i).choice(count, TOP, replace=False) for i in range(len(bits))],
    }
    for seed, memory in zip(SEEDS, memories, strict=True):
        orders[f"encoder {seed}"] = [rank(memory, unpack(grid))[0][:TOP] for grid in grids]
    return {way: np.stack(order) for way, order in orders.items()}


def slightly_changed(problem: Problem) -> Problem:
    """The problem with each obstacle moved a little, in a direction of its own."""
    obstacles = problem.obstacles
    vertices = obstacles.vertices.copy()
    rng = generator(0, "change", problem.id)
    for i in range(len(obstacles.obstacle_starts) - 1):
        pieces = obstacles.obstacle_starts[i : i + 2]
        first, last = obstacles.piece_starts[pieces[0]], obstacles.piece_starts[pieces[1]]
        vertices[first:last] += CHANGE_M * rng.standard_normal(2)
    return dataclasses.replace(problem, obstacles=obstacles._replace(vertices=vertices))
