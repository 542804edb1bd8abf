"""Trains the encoder, deterministically for a seed and from any checkpoint; torch is imported when needed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from planners.memory.encoder.encoder import Architecture, Weights, architecture_of, initial_weights
from planners.memory.encoder.splits import first_of_each, split
from planners.memory.ranking.readout import centroids_of, label_readout, nearest_readout
from planners.world.arrays import Flags, Floats32, Integers
from planners.world.geometry.occupancy import Bits, Grid
from planners.world.randomness import generator

if TYPE_CHECKING:
    from planners.memory.encoder.objectives import Objective

OBJECTIVES: Final = ("labels", "triplet")
CENTROID_SAMPLE = 50  # training problems of each plan, for the centroids of an epoch's metrics
ORIGIN_LEFT: Final = 0.1  # share of the origin's weight that is left in the last epoch


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a training."""

    objective: str = "labels"
    epochs: int = 12  # at most
    patience: int = 4  # training ends after so many epochs without a better hit@1 on validation problems
    batch: int = 128  # problems
    learning_rate: float = 3e-3  # the highest of a one-cycle schedule
    weight_decay: float = 0.1  # decoupled, AdamW
    first_weight: float = 1.0  # label objective: how much it counts that a free plan comes first
    origin_weight: float = 0.0  # label objective: how much it counts, at first, that the origin comes first
    by_cells: bool = True  # label objective: what blocked cells tell is known, and not learned
    margin: float = 1.0  # triplet objective
    semi_hard: bool = False  # triplet objective: count only semi-hard triplets
    own_anchors: bool = False  # triplet objective: anchors, too, were made for the plan, as published
    architecture: Architecture = field(default_factory=Architecture)
    held_out_share: float = 0.1  # of the problems, to measure recall with; training never sees them
    validation_share: float = 0.05  # of the problems, to choose the best epoch and the best seed with
    seed: int = 0
    threads: int = 1  # results depend on this number

    def __post_init__(self) -> None:
        if self.objective not in OBJECTIVES:
            raise ValueError(f"Unknown objective {self.objective!r}; choose one of {', '.join(OBJECTIVES)}.")
        counts = {"epochs": 1, "patience": 1, "batch": 2, "threads": 1}
        for name, least in counts.items():
            if getattr(self, name) < least:
                raise ValueError(f"{getattr(self, name)} {name}: give {least} or more.")
        for name in ("learning_rate", "margin"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}: give a number above 0.")
        for name in ("first_weight", "origin_weight", "weight_decay"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}: give 0 or more.")
        shares = (self.held_out_share, self.validation_share)
        if min(shares) <= 0.0 or sum(shares) >= 1.0:
            raise ValueError(
                f"shares held out and to validate with are {shares}: leave problems to train with."
            )


class Epoch(NamedTuple):
    """Metrics of an epoch on the validation problems; hit@k says that one of the first k plans is free."""

    epoch: int  # from 1
    loss: float  # mean over the epoch's batches
    hit_1: float
    hit_5: float
    oracle: float  # share of validation problems in which any stored plan is free
    seconds: float  # of training so far


class Checkpoint(NamedTuple):
    """Where training stands after an epoch: enough to go on as if it had never stopped."""

    history: tuple[Epoch, ...]
    values: Floats32  # [P] all parameters, the objective's own after the encoder's
    mean: Floats32  # [P] of the gradients (``adamw.AdamW``)
    square: Floats32  # [P] of the gradients' squares
    best: Floats32  # [P] the parameters after the best epoch so far


@dataclass(frozen=True, eq=False)
class TrainedEncoder:
    """The result of a training: the parameters after the best epoch, and what follows from them."""

    settings: TrainingSettings
    weights: Weights
    centroids: Floats32  # [N + 1, D] mean embedding of each plan's problems; row 0: of those no plan solves
    vectors: Floats32  # [N + 1, D] readout
    biases: Floats32  # [N + 1] readout; row 0 decides when nothing is recalled (``readout.py``)
    popularity: Floats32  # [N] share of the training problems in which each plan is free
    history: tuple[Epoch, ...]
    held_out: Integers  # [h] numbers of the problems that training did not see

    @property
    def score(self) -> float:
        """By what trainings are compared: the best epoch's hit@1 on the validation problems."""
        return max(epoch.hit_1 for epoch in self.history)


def train(
    grids_packed: Grid,
    plan_index: Integers,
    labels: Flags,
    masks: Bits,
    settings: TrainingSettings,
    on_epoch: Callable[[Checkpoint], None] | None = None,
    checkpoint: Checkpoint | None = None,
    warm: Weights | None = None,
) -> TrainedEncoder:
    """Train an encoder on n problems, on a GPU if torch sees one.

    Args:
        grids_packed: uint8 ``[n, 512]`` their occupancy grids, packed.
        plan_index: ``[n]`` the plan that each was made for, -1 for none.
        labels: bool ``[n, N]`` which plans are free in each.
        masks: ``[N, 64]`` the cells that each plan sweeps.
        settings: of the training.
        on_epoch: is called with a checkpoint after each epoch.
        checkpoint: of an earlier training, which goes on from there to the same end.
        warm: weights for the encoder to begin with instead of random ones.

    Raises:
        ValueError: There is not one of each for every problem, or not a mask for each plan; some plan has no
            problems; or ``warm`` is of another architecture.
    """
    from planners.memory.encoder.device import deterministic
    from planners.memory.encoder.learner import Learner

    if not len(grids_packed) == len(plan_index) == len(labels):
        raise ValueError(
            f"{len(grids_packed)} grids, {len(plan_index)} plan indices and {len(labels)} label vectors: "
            "training needs one of each for every problem"
        )
    if labels.shape[1] != len(masks):
        raise ValueError(f"labels are of {labels.shape[1]} plans, masks of {len(masks)}: give one each")
    if warm is not None and architecture_of(warm) != settings.architecture:
        raise ValueError(
            f"weights to begin with are of {architecture_of(warm)}, expected {settings.architecture}: "
            "begin anew, or with the same sizes"
        )
    parts = split(plan_index, labels, settings.validation_share, settings.held_out_share)
    free = np.concatenate([~labels.any(1, keepdims=True), labels], 1)
    rows = np.where(plan_index >= 0, plan_index + 1, np.where(free[:, 0], 0, -1)).astype(np.int32)
    sample = parts.training[first_of_each(rows[parts.training], CENTROID_SAMPLE)]
    steps = -(-len(parts.training) // settings.batch)  # an epoch
    objective = _objective(settings, 0)
    weights = initial_weights(settings.architecture, generator(settings.seed, "weights"))
    if warm is not None:
        weights = {name: warm[name] for name in weights}  # in the order of the initial ones
    dimensions = settings.architecture.dimensions
    own = objective.initial(free.shape[1], dimensions, generator(settings.seed, "readout"))
    history = list(checkpoint.history) if checkpoint else []
    began = time.perf_counter() - (history[-1].seconds if history else 0.0)
    with deterministic(settings.threads) as device:
        problems = (grids_packed, rows, free)
        learner = Learner(problems, masks, weights, own, settings.weight_decay, device)
        if checkpoint is not None:
            learner.restore(checkpoint[1:], len(history) * steps)
        while len(history) < settings.epochs and not _is_tired(history, settings.patience):
            order = generator(settings.seed, "epoch", len(history)).permutation(parts.training)
            objective = _objective(settings, len(history))
            loss = learner.epoch(
                objective, order, settings.batch, settings.epochs * steps, settings.learning_rate
            )
            scores = learner.scores(objective, parts.validation, sample)
            free_plans = labels[parts.validation]
            oracle = float(free_plans.any(1).mean())
            hits = (hit_rate(scores, free_plans, 1), hit_rate(scores, free_plans, 5), oracle)
            if hits[0] >= max((epoch.hit_1 for epoch in history), default=0.0):
                learner.keep()
            history.append(Epoch(len(history) + 1, loss, *hits, time.perf_counter() - began))
            if on_epoch is not None:
                on_epoch(Checkpoint(tuple(history), *learner.state()))
        learned, embeddings = learner.best(), learner.best_embeddings(parts.training)
    centroids, scatter = centroids_of(embeddings, rows[parts.training], free.shape[1])
    if own:
        vectors, biases = label_readout(*(learned[name] for name in own))
    else:
        vectors, biases = nearest_readout(centroids, scatter)
    return TrainedEncoder(
        settings=settings,
        weights={name: learned[name] for name in weights},
        centroids=centroids,
        vectors=vectors,
        biases=biases,
        popularity=labels[parts.training].mean(0, dtype=np.float32),
        history=tuple(history),
        held_out=parts.held_out,
    )


def hit_rate(plan_scores: Floats32, labels: Flags, k: int) -> float:
    """Return the share of n problems in which one of the k best plans is free.

    ``plan_scores [n, N]`` ranks the plans, ``labels [n, N]`` says which are free.
    """
    best = np.argsort(-plan_scores, axis=1, kind="stable")[:, :k]
    return float(np.take_along_axis(labels, best, axis=1).any(1).mean())


def _objective(settings: TrainingSettings, epoch: int) -> Objective:
    """The objective of an epoch, counted from 0. The weight of the origin falls linearly."""
    from planners.memory.encoder.objectives import Labels, Triplet

    if settings.objective == "labels":
        left = 1.0 - (1.0 - ORIGIN_LEFT) * epoch / max(1, settings.epochs - 1)
        return Labels(settings.first_weight, left * settings.origin_weight, settings.by_cells)
    return Triplet(settings.margin, settings.semi_hard, settings.own_anchors)


def _is_tired(history: list[Epoch], patience: int) -> bool:
    """Whether the last ``patience`` epochs were no better than the best one before."""
    hits = [epoch.hit_1 for epoch in history]
    return len(hits) > patience and max(hits[-patience:]) < max(hits[:-patience])
