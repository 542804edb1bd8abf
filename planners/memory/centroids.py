"""From a trained encoder to a memory: the mean embedding of each plan's problems, and the readout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from planners.memory.encoder import Encoder, Floats32, to_onnx
from planners.memory.labels import sweep_plans
from planners.memory.masks import masks_of
from planners.memory.recall import Memory
from planners.memory.training import TrainedEncoder
from planners.world.occupancy import GRID, Grid
from planners.world.problem import Integers, Plan
from planners.world.vehicle import CAR, Vehicle

BATCH = 256  # grids embedded at once
NO_PLAN_ODDS = 20.0  # recalling in vain costs microseconds, not recalling a free plan costs a search


def centroids_of(
    encoder: Encoder, grids_packed: Grid, plan_index: Integers, plans: int
) -> tuple[Floats32, float]:
    """Mean embedding ``[N + 1, D]`` of each plan's problems (bits uint8 ``[n, 512]``); row 0: of those of -1.

    With it their scatter: the mean squared distance of a problem to its own row. Row 0 without problems
    is infinitely far from everything; a plan without problems is a ValueError.
    """
    embeddings = np.concatenate(
        [
            encoder(np.unpackbits(grids_packed[i : i + BATCH], axis=1).reshape(-1, GRID, GRID))
            for i in range(0, len(grids_packed), BATCH)
        ]
    ).astype(np.float64)
    rows = plan_index.astype(np.int64) + 1
    counts = np.bincount(rows, minlength=plans + 1)
    if len(counts) > plans + 1 or not counts[1:].all():
        missing = np.flatnonzero(counts[1:] == 0).tolist()
        raise ValueError(
            f"problems belong to {np.count_nonzero(counts[1:])} plans, {plans} are stored (without problems: "
            f"{missing}): hallucinate problems for each stored plan"
        )
    sums = np.zeros((plans + 1, embeddings.shape[1]))
    np.add.at(sums, rows, embeddings)
    if counts[0] == 0:
        sums[0], counts[0] = np.inf, 1
    centroids = sums / counts[:, np.newaxis]
    scatter = np.square(embeddings - centroids[rows]).sum(1).mean()
    return centroids.astype(np.float32), float(scatter)


def nearest_readout(centroids: Floats32) -> tuple[Floats32, Floats32]:
    """Vectors and biases whose scores ``w . e + b`` order rows as the distance of e to the centroids does.

    ``|e - c|^2 = |e|^2 - 2 (c . e - |c|^2 / 2)``. An infinitely far row never wins.
    """
    vectors = np.where(np.isfinite(centroids), centroids, np.float32(0.0))
    biases = np.where(np.isfinite(centroids).all(1), -0.5 * np.square(vectors).sum(1), np.float32(-np.inf))
    return vectors, biases.astype(np.float32)


def build_memory(
    trained: TrainedEncoder,
    grids_packed: Grid,
    plan_index: Integers,
    plans: Sequence[Plan],
    class_name: str,
    vehicle: Vehicle = CAR,
    metadata: dict[str, Any] | None = None,
) -> Memory:
    """Memory of N ``plans`` from the problems of training: bits uint8 ``[n, 512]``, plan indices ``[n]``."""
    encoder = Encoder(to_onnx(trained.weights))
    centroids, scatter = centroids_of(encoder, grids_packed, plan_index, len(plans))
    if trained.vectors is None or trained.biases is None:
        # Recall unless c_0 is clearly nearer, by twice the scatter in squared distance: with no margin 21 %
        # of the solvable problems of class random were given up, with it 3 % (one seed).
        vectors, biases = nearest_readout(centroids)
        biases[0] -= np.float32(scatter)
    else:  # logits: recall unless the odds that no plan is free are that many times those of the best plan
        vectors, biases = trained.vectors, trained.biases.copy()
        biases[0] -= np.float32(np.log(NO_PLAN_ODDS))
    sweeps = sweep_plans(plans, vehicle)
    return Memory(
        class_name=class_name,
        vehicle=vehicle,
        plans=tuple(plans),
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=centroids,
        vectors=vectors,
        biases=biases,
        objective=trained.settings.objective,
        weights=trained.weights,
        metadata=metadata or {},
    )
