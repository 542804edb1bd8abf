"""Memories of very many plans to measure with: collected ones, beyond a hundred thousand synthetic ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.progress import track

from planners.memory.growth import grow
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.plan_arrays import StoredPlans, store_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.memory.ranking.inverted_lists import list_readout
from planners.solve import solve
from planners.world.classes.problem_classes import ProblemClass
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, state_size
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from tasks.fan_out.keys import key_of
from tests.speed.assists import COLLECTING, memory_of

TAUGHT = 1_000  # plans that the encoder is trained on
HALLUCINATED = 20  # problems for each of these
READ_OUT = 2_000  # problems that say when each plan is free
LEARNING = 81  # seed of these
EVERY = 8  # states of a stored plan from one to the next that a synthetic one has
SIDEWAYS_M = 1.0  # by which a synthetic plan is bent aside at most, standard deviation

_ARRAYS = ("states", "controls", "starts", "dt")


def collected_plans(source: ProblemClass, count: int, folder: Path) -> StoredPlans:
    """Plans of the first problems that Follow solves, from where they are kept if they are there."""
    place = folder / f"plans-{source.name}-{source.difficulty}-{count}-{key_of(COLLECTING)}"
    try:
        return StoredPlans(*(np.load(place / f"{name}.npy", mmap_mode="c") for name in _ARRAYS))
    except FileNotFoundError:
        pass
    plans: list[Plan] = []
    index = 0
    for _ in track(range(count), description=f"{count:,} plans", transient=True):
        plan = None
        while plan is None:
            asked = source.draw(COLLECTING, index)
            plan = solve(asked, "follow", seed=COLLECTING, polished=False).plan
            index += 1
        plans.append(plan)
    stored = store_plans(plans, state_size(CAR))
    place.mkdir(parents=True)
    for name in _ARRAYS:
        np.save(place / f"{name}.npy", getattr(stored, name))
    return stored


def place_of(source: ProblemClass, count: int, folder: Path) -> Path:
    """Where the memory of that many plans is kept."""
    return folder / f"{source.name}-{source.difficulty}-{count}-{key_of(COLLECTING, LEARNING, HALLUCINATED)}"


def collected_memory(source: ProblemClass, plans: Sequence[Plan], folder: Path) -> Memory:
    """The memory of these plans, its encoder trained on the first, from where it is kept if it is there."""
    place = place_of(source, len(plans), folder)
    try:
        return load_memory(place)
    except StorageError:
        problems = [source.draw(LEARNING, index) for index in range(READ_OUT)]
        taught = memory_of(source.name, source.difficulty, TAUGHT, HALLUCINATED, folder)
        memory = grow(taught, plans, problems)
        save_memory(place, memory)
        return load_memory(place)


def synthetic_memory(memory: Memory, count: int) -> Memory:
    """``count`` plans that nobody could drive: those of ``memory`` again and again, each bent aside a little.

    Every eighth state of a plan, moved sideways by up to a metre or two in the middle and by nothing at its
    ends. Controls are zero. The readout of a plan is that of the plan it was made from, and a little noise.
    """
    rng = np.random.default_rng(LEARNING)
    parents = np.arange(count) % len(memory.plans)
    starts = np.zeros(count + 1, np.int64)
    whole = np.diff(memory.plans.starts) if isinstance(memory.plans, StoredPlans) else None
    assert whole is not None
    np.cumsum(-(-whole[parents] // EVERY), out=starts[1:])
    states = np.empty((starts[-1], state_size(CAR)))
    for i in track(range(count), description=f"{count:,} synthetic plans", transient=True):
        part = memory.plans[int(parents[i])].states[::EVERY]
        aside = SIDEWAYS_M * rng.standard_normal() * np.sin(np.linspace(0.0, np.pi, len(part)))
        own = states[starts[i] : starts[i + 1]]
        own[:] = part
        own[:, 0] -= aside * np.sin(part[:, 2])
        own[:, 1] += aside * np.cos(part[:, 2])
    plans = StoredPlans(states, np.zeros((len(states) - count, 2)), starts, np.full(count, EVERY * CAR.dt))
    sweeps = sweep_plans(plans)
    rows = np.concatenate(([0], parents + 1))
    vectors = memory.vectors[rows] * (1.0 + 0.05 * rng.standard_normal(memory.vectors[rows].shape))
    vectors, biases = vectors.astype(np.float32), memory.biases[rows]
    return replace(
        memory,
        plans=plans,
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=memory.centroids[rows],
        vectors=vectors,
        biases=biases,
        lists=list_readout(vectors, biases),
    )
