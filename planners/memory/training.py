"""Training the encoder, deterministic for a seed; torch is imported when training begins."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from planners.memory.encoder import Architecture, Floats32, Weights, initial_weights
from planners.memory.labels import Flags
from planners.world.occupancy import Grid
from planners.world.problem import Integers
from planners.world.randomness import generator

OBJECTIVES: Final = ("labels", "triplet")
CENTROID_SAMPLE = 50  # training problems a plan, for the centroids of an epoch's metrics
WARM_UP = 0.3  # share of the steps in which the learning rate rises (Smith and Topin 2018)


@dataclass(frozen=True)
class TrainingSettings:
    """How to train."""

    objective: str = "labels"
    epochs: int = 12
    batch: int = 128  # problems
    learning_rate: float = 3e-3  # the highest of a one-cycle schedule
    weight_decay: float = 0.1  # decoupled, AdamW
    margin: float = 1.0  # of the triplet objective
    architecture: Architecture = field(default_factory=Architecture)
    validation_share: float = 0.1  # of the problems, held out
    seed: int = 0
    threads: int = 1  # results are the same for the same number

    def __post_init__(self) -> None:
        if self.objective not in OBJECTIVES:
            raise ValueError(f"Unknown objective {self.objective!r}; choose one of {', '.join(OBJECTIVES)}.")
        if self.epochs < 1 or self.batch < 2 or self.threads < 1 or not 0.0 < self.validation_share < 1.0:
            raise ValueError(f"{self} cannot be trained with: it takes an epoch, pairs, a thread, two splits")


class Epoch(NamedTuple):
    """Metrics after one epoch, on the held-out problems; hit@k: one of the first k plans is free."""

    epoch: int  # from 1
    loss: float  # mean over the epoch's batches
    hit_1: float
    hit_5: float
    oracle: float  # share of held-out problems in which any stored plan is free
    seconds: float  # since training began


@dataclass(frozen=True, eq=False)
class TrainedEncoder:
    """What training leaves."""

    settings: TrainingSettings
    weights: Weights
    vectors: Floats32 | None  # [N + 1, D] learned readout; None for the triplet objective
    biases: Floats32 | None  # [N + 1]
    history: tuple[Epoch, ...]
    validation: Integers  # [v] indices of the problems that were held out


def train(
    grids_packed: Grid,
    plan_index: Integers,
    labels: Flags,
    settings: TrainingSettings,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> TrainedEncoder:
    """Train on n problems: grids as bits uint8 ``[n, 512]``, and which of N plans are free bool ``[n, N]``.

    ``plan_index [n]`` is the plan that each problem was made for, -1 for ``S_0``. Calls ``on_epoch`` after
    each epoch. Uses a GPU where torch sees one.
    """
    import torch

    from planners.memory.network import embed, embed_all
    from planners.memory.objectives import Labels, Objective, Triplet

    if not len(grids_packed) == len(plan_index) == len(labels) or len(labels) < 2:
        raise ValueError(
            f"{len(grids_packed)} grids, {len(plan_index)} plan indices and {len(labels)} label vectors: "
            "training needs one of each for every problem, and two problems at least"
        )
    began = time.perf_counter()
    order = generator(settings.seed, "split").permutation(len(labels)).astype(np.int32)
    held_out = max(1, round(settings.validation_share * len(labels)))
    validation, training = np.sort(order[:held_out]), np.sort(order[held_out:])
    free_rows = np.concatenate([~labels.any(1, keepdims=True), labels], 1)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    objective: Objective = Triplet(settings.margin)
    if settings.objective == "labels":
        rng = generator(settings.seed, "readout")
        objective = Labels(free_rows.shape[1], settings.architecture.dimensions, rng, device)
    orders = [generator(settings.seed, "epoch", i).permutation(training) for i in range(settings.epochs)]
    sample = orders[0][_first_of_each(plan_index[orders[0]], CENTROID_SAMPLE)]
    history: list[Epoch] = []
    with _deterministic(settings.threads):
        bits = torch.from_numpy(np.ascontiguousarray(grids_packed)).to(device)
        rows = torch.from_numpy(plan_index.astype(np.int64) + 1).to(device)
        targets = torch.from_numpy(free_rows).to(device)
        weights = initial_weights(settings.architecture, generator(settings.seed, "weights"))
        parameters = {name: torch.from_numpy(value).to(device) for name, value in weights.items()}
        trained = [*parameters.values(), *objective.parameters]
        for parameter in trained:
            parameter.requires_grad_(True)
        optimiser = torch.optim.AdamW(trained, lr=settings.learning_rate, weight_decay=settings.weight_decay)
        steps = sum(-(-len(each) // settings.batch) for each in orders)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, settings.learning_rate, total_steps=steps, pct_start=WARM_UP
        )
        for i in range(settings.epochs):
            losses = []
            for batch in torch.split(torch.from_numpy(orders[i]).to(device), settings.batch):
                loss = objective.loss(embed(parameters, bits[batch]), rows[batch], targets[batch])
                optimiser.zero_grad()
                torch.autograd.backward(loss)
                optimiser.step()
                schedule.step()
                losses.append(loss.detach())
            with torch.no_grad():
                embeddings = embed_all(parameters, bits[sample])
                vectors, biases = objective.readout(embeddings, rows[sample], free_rows.shape[1])
                scores = (embed_all(parameters, bits[validation]) @ vectors.T + biases)[:, 1:].cpu().numpy()
            epoch = Epoch(
                epoch=i + 1,
                loss=float(torch.stack(losses).mean()),
                hit_1=hit_rate(scores, labels[validation], 1),
                hit_5=hit_rate(scores, labels[validation], 5),
                oracle=float(labels[validation].any(1).mean()),
                seconds=time.perf_counter() - began,
            )
            history.append(epoch)
            if on_epoch is not None:
                on_epoch(epoch)
    learned = bool(objective.parameters)
    return TrainedEncoder(
        settings,
        {name: value.detach().cpu().numpy() for name, value in parameters.items()},
        vectors.cpu().numpy() if learned else None,
        biases.cpu().numpy() if learned else None,
        tuple(history),
        validation,
    )


@contextmanager
def _deterministic(threads: int) -> Iterator[None]:
    """Torch on that many threads, with deterministic kernels only; as it was before, afterwards."""
    import torch

    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # without it cuBLAS is not deterministic
    before, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(True)
    try:
        yield
    finally:
        torch.set_num_threads(before)
        torch.use_deterministic_algorithms(deterministic)


def hit_rate(plan_scores: Floats32, labels: Flags, k: int) -> float:
    """Share of n problems in which one of the k best plans is free: scores ``[n, N]``, labels ``[n, N]``."""
    best = np.argsort(-plan_scores, axis=1, kind="stable")[:, :k]
    return float(np.take_along_axis(labels, best, axis=1).any(1).mean())


def _first_of_each(values: Integers, count: int) -> Integers:
    """Indices of the first ``count`` occurrences of each value, in order."""
    order = np.argsort(values, kind="stable")
    begins = np.flatnonzero(np.diff(values[order], prepend=values[order[0]] - 1))
    rank = np.arange(len(values)) - np.repeat(begins, np.diff(begins, append=len(values)))
    return np.sort(order[rank < count]).astype(np.int32)
