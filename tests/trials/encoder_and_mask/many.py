"""How often the first plans of very large memories are free, and how long ranking takes with cold caches.

Ten thousand plans are collected. A million are these and 99 more around each: its controls with a steering
that swerves aside and back at two random moments, driven anew from the start by the vehicle's own equations,
within its limits, and kept if they end in the goal disc and stay within the bounds. So each can be driven;
but they are nearer to each other than collected plans would be. Kept are their masks, and what they are
driven from again to be checked.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from time import perf_counter, thread_time
from typing import Any, Final

import numpy as np

from planners.memory.build_memory import build_memory
from planners.memory.encoder.training import TrainingSettings, train
from planners.memory.growth import EVEN_CELLS, Moments, beside_cells, grow, ridge_readout
from planners.memory.labelling import label_problems
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import CELL_SCORES, masks_of, rank_by_cells
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import ends_of, plan_fits
from planners.memory.plans.sweeps import sweep_plans
from planners.memory.ranking.inverted_lists import FROM_PLANS, list_readout
from planners.memory.ranking.scores import best_plans
from planners.memory.recall import CANDIDATES, by_readout, scored
from planners.world.arrays import Floats, Integers
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import Bits, bits_of, occupancy_of
from planners.world.jit import jit
from planners.world.problem import Plan, Problem, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import admissible, load, step, store
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.view import View
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.trials.encoder_and_mask.worlds import (
    CITIES,
    COLLECTING,
    drawer_of,
    drawn_of,
    hallucinated,
    problems_of,
    solved,
)

CLASS: Final = "random-hard"
WORLDS: Final = (CLASS, CITIES[3], CITIES[2])
SEEDS: Final = (0, 1, 2)
COLLECTED: Final = 10_000
TAUGHT: Final = 1_000
HALLUCINATED: Final = 10
EPOCHS: Final = 8
READ_OUT: Final = 2_000
AROUND: Final = 99  # plans made around each collected one
PULSE: Final = 0.35  # rad/s, standard deviation of the steering rate that swerves
PROBLEMS: Final = 300
TOP: Final = 5
PART: Final = 20_000  # plans whose cells are counted at once


def collected() -> list[Experience]:
    """Problems of the class with their plans."""
    return list(islice(solved(problems_of(CLASS, 2 * COLLECTED, COLLECTING)), COLLECTED))


def taught_memories(experiences: Sequence[Experience]) -> list[Memory]:
    """A memory of all plans for each training seed; its encoder is taught the first thousand."""
    taught = experiences[:TAUGHT]
    plans = [each.plan for each in taught]
    sweeps = sweep_plans(plans)
    made, made_for = hallucinated(CLASS, taught, sweeps, drawer_of(CLASS, []), HALLUCINATED)
    plain = drawn_of(CLASS, len(made))
    grids, free = label_problems(made + plain, sweeps)
    origins = np.array(made_for + [-1] * len(plain), np.int32)
    every = [each.plan for each in experiences]
    memories = []
    for seed in SEEDS:
        settings = TrainingSettings(epochs=EPOCHS, seed=seed, by_cells=False)
        trained = train(grids, origins, free, masks_of(sweeps), settings)
        memories.append(grow(build_memory(trained, plans, CLASS), every, plain[:READ_OUT]))
    return memories


@jit
def driven(start: Floats, controls: Floats, pulses: Floats, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Drive ``controls [T - 1, 2]`` with each of ``pulses [B, 4]``: states ``[B, T, S]``, controls.

    A pulse: steering rate (rad/s), the steps at which it swerves aside and back, and for how many steps.
    """
    count = pulses.shape[0]
    steps = controls.shape[0]
    states = np.empty((count, steps + 1, start.shape[0]))
    used = np.empty((count, steps, 2))
    for b in range(count):
        for k in range(start.shape[0]):
            states[b, 0, k] = start[k]
        state = load(states[b], 0, vehicle)
        width = int(pulses[b, 3])
        for i in range(steps):
            rate = controls[i, 1]
            for turn in range(2):
                since = i - int(pulses[b, 1 + turn])
                sign = 1.0 if turn == 0 else -1.0
                if 0 <= since < width or 3 * width <= since < 4 * width:
                    rate += sign * pulses[b, 0]
                elif width <= since < 3 * width:
                    rate -= sign * pulses[b, 0]
            rate = min(max(rate, -vehicle.max_steering_rate), vehicle.max_steering_rate)
            first, second = admissible(state, controls[i, 0], rate, vehicle)
            state = step(state, first, second, vehicle)
            store(states[b], i + 1, state)
            used[b, i, 0] = first
            used[b, i, 1] = second
    return states, used


class Around(Sequence[Plan]):
    """Collected plans, each followed by those that were driven around it."""

    def __init__(self, parents: Sequence[Plan], pulses: Floats) -> None:
        self.parents, self.pulses = parents, pulses  # pulses [N, 4]; zeros for a collected plan

    def __len__(self) -> int:
        return len(self.pulses)

    def __getitem__(self, index: Any) -> Any:
        parent = self.parents[index // (AROUND + 1)]
        if not self.pulses[index, 0]:
            return parent
        states, used = driven(parent.states[0], parent.controls, self.pulses[index : index + 1], CAR)
        return Plan(states[0], used[0], parent.dt)


def around(parents: Sequence[Plan]) -> tuple[Around, Bits]:
    """The million plans, and their masks."""
    pulses, masks = [], []
    for number, parent in enumerate(parents):
        mine, plans = pulses_of(parent, number)
        pulses.append(mine)
        masks.append(masks_of(sweep_plans(plans)))
    return Around(parents, np.concatenate(pulses)), np.concatenate(masks)


def pulses_of(parent: Plan, number: int) -> tuple[Floats, list[Plan]]:
    """Swerves of a plan that fit an empty world, the plan itself first, and the plans driven with them."""
    rng = generator(COLLECTING, "around", number)
    scene, ends = scene_of(empty_problem()), ends_of(empty_problem())
    kept, plans = [np.zeros((1, 4))], [parent]
    steps, size = len(parent.controls), PULSE
    while len(plans) < AROUND + 1:
        width = rng.integers(3, max(4, steps // 12), 2 * AROUND)
        moments = np.sort(rng.integers(0, steps, (2 * AROUND, 2)), axis=1)
        drawn = np.column_stack((size * rng.standard_normal(2 * AROUND), moments, width))
        states, used = driven(parent.states[0], parent.controls, drawn, CAR)
        made = [Plan(*each, parent.dt) for each in zip(states, used, strict=True)]
        sweeps = sweep_plans(made)
        good = [i for i in range(len(made)) if plan_fits(sweeps, i, ends, scene)[0]]
        good = good[: AROUND + 1 - len(plans)]
        kept.append(drawn[good])
        plans += [made[i] for i in good]
        size *= 0.7
    return np.concatenate(kept), plans


def enlarged(
    memories: Sequence[Memory], plans: Sequence[Plan], masks: Bits, problems: Sequence[Problem]
) -> list[Memory]:
    """The memories with other plans, read out from how many of their cells are blocked in some problems.

    Checking them exactly, as ``grow`` does, would take half a microsecond a plan and problem, 17 minutes.
    """
    grids = np.stack([occupancy_of(problem) for problem in problems])
    bits = bits_of(grids)
    embeddings = [memory.encoder(grids) for memory in memories]
    free = 1.0 / (1.0 + np.exp(np.minimum(CELL_SCORES[EVEN_CELLS] - CELL_SCORES, 50.0)))  # by blocked cells
    counts = np.zeros(len(masks) + 1)
    sums = [np.zeros((len(masks) + 1, each.shape[1])) for each in embeddings]
    for first in range(0, len(masks), PART):
        part = masks[first : first + PART]
        rows = slice(1 + first, 1 + first + len(part))
        likely = np.stack([free[rank_by_cells(part, each).cells] for each in bits])
        counts[rows] = likely.sum(0)
        for mine, embedding in zip(sums, embeddings, strict=True):
            mine[rows] = likely.T @ embedding
    made = []
    for memory, embedding, mine in zip(memories, embeddings, sums, strict=True):
        readout = ridge_readout(embedding, Moments(counts, mine, np.zeros(len(counts))))
        vectors, biases = beside_cells(*readout)
        lists = list_readout(vectors, biases) if len(masks) >= FROM_PLANS else None
        parts = {"vectors": vectors, "biases": biases, "centroids": vectors, "lists": lists}
        made.append(dataclasses.replace(memory, plans=plans, masks=masks, **parts))
    return made


def rankings(memories: Sequence[Memory], popularity: Floats) -> dict[str, Callable[[View, int], Integers]]:
    """Each way to rank: from a problem seen anew, and its number, to its first plans ``[TOP]``."""
    masks, count = memories[0].masks, len(memories[0].plans)
    popular = np.argsort(-popularity, kind="stable")[:TOP]

    def by_encoder(memory: Memory, view: View) -> Integers:
        among, scores = scored(memory, memory.forward(view.bits), view.bits, TOP, view.workspace)
        return among[best_plans(scores, TOP, never_none=True)]

    def by_both(memory: Memory, view: View) -> Integers:
        among = by_readout(memory, memory.forward(view.bits), CANDIDATES)
        return among[rank_by_cells(memory.masks[among], view.bits).order[:TOP]]

    ways: dict[str, Callable[[View, int], Integers]] = {
        "mask": lambda view, number: rank_by_cells(masks, view.bits, view.workspace).order[:TOP].copy(),
        "popularity": lambda view, number: popular,
        "blind": lambda view, number: generator(0, "blind", number).integers(0, count, TOP),
    }
    for seed, memory in zip(SEEDS, memories, strict=False):
        ways[f"encoder {seed}"] = lambda view, number, memory=memory: by_encoder(memory, view)
        ways[f"hybrid {seed}"] = lambda view, number, memory=memory: by_both(memory, view)
    return ways


def measured(memories: Sequence[Memory], popularity: Floats, world: str) -> dict[str, Any]:
    """A row of a world: whether the first plans of each ranking are free, and processor time in us, cold."""
    problems = problems_of(world, PROBLEMS)
    plans = memories[0].plans
    rows: dict[str, Any] = {"memory": f"{len(plans)}", "world": world, "problems": len(problems)}
    other = OtherWork()
    ways = rankings(memories, popularity)
    for way, ranked in ways.items():
        ranked(View(problems[0]), 0)  # compiled now
        seconds, hits = [], []
        with no_garbage_collection():
            for number, problem in enumerate(problems):
                other()
                view = View(problem)
                began = thread_time()
                order = ranked(view, number)
                seconds.append(thread_time() - began)
                sweeps = sweep_plans([plans[int(i)] for i in order])
                scene, ends = scene_of(problem), ends_of(problem)
                hits.append([plan_fits(sweeps, i, ends, scene)[0] for i in range(len(order))])
        free = np.array(hits)
        rows[f"{way} first"], rows[f"{way} five"] = free[:, 0].tolist(), free.any(1).tolist()
        rows[f"{way} us"] = [1e6 * float(q) for q in np.quantile(seconds, (0.5, 0.99))]
    return rows


def judged(plans: Around, count: int) -> int:
    """How many of ``count`` plans the authority refuses, each in an empty world."""
    chosen = np.random.default_rng(0).integers(0, len(plans), count)
    return sum(bool(faults(empty_problem(), plans[int(i)])) for i in chosen)


@functools.cache
def empty_problem() -> Problem:
    """The canonical problem without obstacles."""
    problem = problems_of(CLASS, 1)[0]
    return dataclasses.replace(problem, obstacles=obstacles_of([]))


def report_rows() -> Iterator[dict[str, Any]]:
    """Rows of ten thousand and of a million plans, a world each."""
    began = perf_counter()

    def said(what: str) -> None:
        print(f"{what}: {perf_counter() - began:.0f} s", flush=True)

    experiences = collected()
    said("collected")
    memories = taught_memories(experiences)
    said("taught and grown")
    sample = drawn_of(CLASS, READ_OUT)
    popularity = label_problems(sample[:500], memories[0].sweeps).free.mean(0)
    for world in WORLDS:
        free = label_problems(problems_of(world, PROBLEMS), memories[0].sweeps).free
        yield {**measured(memories, popularity, world), "oracle": free.any(1).tolist()}
    said("ten thousand measured")
    by_cells = enlarged(memories, memories[0].plans, memories[0].masks, sample[:1_000])
    yield {**measured(by_cells, popularity, WORLDS[0]), "memory": f"{COLLECTED} by cells"}
    plans, masks = around([each.plan for each in experiences])
    said("driven around")
    print(f"refused by the authority: {judged(plans, 1_000)} of 1,000", flush=True)
    large = enlarged(memories, plans, masks, sample[:1_000])
    said("enlarged")
    likely = np.repeat(popularity, AROUND + 1)
    for world in WORLDS:
        yield measured(large, likely, world)
    said("a million measured")
