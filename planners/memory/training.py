"""Training the encoder, deterministic for a seed; torch is imported when training begins."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
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
    epochs: int = 15
    batch: int = 128  # problems
    learning_rate: float = 3e-3  # the highest of a one-cycle schedule, for Adam
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
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # what makes cuBLAS deterministic
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    threads, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(settings.threads)
    torch.use_deterministic_algorithms(True)
    try:
        bits = torch.from_numpy(np.ascontiguousarray(grids_packed)).to(device)
        rows = torch.from_numpy(plan_index.astype(np.int64) + 1).to(device)
        free = np.concatenate([~labels.any(1, keepdims=True), labels], 1)
        targets = torch.from_numpy(free).to(device)
        weights = initial_weights(settings.architecture, generator(settings.seed, "weights"))
        parameters = {name: torch.from_numpy(value).to(device) for name, value in weights.items()}
        objective: Objective
        if settings.objective == "labels":
            rng = generator(settings.seed, "readout")
            objective = Labels(free.shape[1], settings.architecture.dimensions, rng, device)
        else:
            objective = Triplet(settings.margin)
        trained = [*parameters.values(), *objective.readout.values()]
        for parameter in trained:
            parameter.requires_grad_(True)
        optimiser = torch.optim.Adam(trained, lr=settings.learning_rate)
        orders = [
            training[objective.epoch(plan_index[training], generator(settings.seed, "epoch", epoch))]
            for epoch in range(settings.epochs)
        ]
        steps = sum(-(-len(epoch_order) // settings.batch) for epoch_order in orders)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, settings.learning_rate, total_steps=steps, pct_start=WARM_UP
        )
        sample = torch.from_numpy(_first_of_each(plan_index[orders[0]], CENTROID_SAMPLE))
        sample = torch.from_numpy(orders[0]).to(device)[sample]
        held = torch.from_numpy(validation).to(device)
        history: list[Epoch] = []
        for number, epoch_order in enumerate(orders, 1):
            losses = []
            for batch in torch.split(torch.from_numpy(epoch_order).to(device), settings.batch):
                loss = objective.loss(embed(parameters, bits[batch]), rows[batch], targets[batch])
                optimiser.zero_grad()
                torch.autograd.backward(loss)
                optimiser.step()
                schedule.step()
                losses.append(loss.detach())
            with torch.no_grad():
                if objective.readout:
                    vectors, biases = objective.readout["vectors"], objective.readout["biases"]
                else:
                    vectors = torch.zeros((free.shape[1], settings.architecture.dimensions), device=device)
                    counts = torch.bincount(rows[sample], minlength=len(vectors)).clamp(min=1)
                    vectors.index_add_(0, rows[sample], embed_all(parameters, bits[sample]))
                    vectors /= counts[:, None]
                    biases = -0.5 * vectors.square().sum(1)
                scores = embed_all(parameters, bits[held]) @ vectors.T + biases
            hit_1, hit_5 = (hit_rate(scores[:, 1:].cpu().numpy(), labels[validation], k) for k in (1, 5))
            mean_loss = float(torch.stack(losses).mean())
            oracle = float(labels[validation].any(1).mean())
            history.append(Epoch(number, mean_loss, hit_1, hit_5, oracle, time.perf_counter() - began))
            if on_epoch is not None:
                on_epoch(history[-1])
        return TrainedEncoder(
            settings,
            {name: value.detach().cpu().numpy() for name, value in parameters.items()},
            vectors.detach().cpu().numpy() if objective.readout else None,
            biases.detach().cpu().numpy() if objective.readout else None,
            tuple(history),
            validation,
        )
    finally:
        torch.set_num_threads(threads)
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
