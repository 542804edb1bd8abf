"""A memory whose encoder has learned nothing, with centroids of random grids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planners.memory.build_memory import build_memory
from planners.memory.encoder.encoder import Architecture, Encoder, initial_weights, to_onnx
from planners.memory.encoder.training import TrainedEncoder, TrainingSettings
from planners.memory.memory import Memory
from planners.memory.plans.experience import Experience
from planners.memory.ranking.readout import centroids_of, nearest_readout
from planners.world.randomness import generator

PLANS = 8
ARCHITECTURE = Architecture(channels=(2, 2), hidden=(), dimensions=6)


def problems(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Packed grids, three for each plan and three that no plan solves, and the plan of each."""
    rng = generator(seed, "recall")
    plan_index = np.repeat(np.arange(-1, PLANS), 3).astype(np.int32)
    density = rng.uniform(0.05, 0.5, (len(plan_index), 1))
    return np.packbits(rng.random((len(plan_index), 4096)) < density, axis=1), plan_index


def untrained_memory(experiences: Sequence[Experience]) -> Memory:
    weights = initial_weights(ARCHITECTURE, generator(0, "weights"))
    bits, plan_index = problems()
    embeddings = Encoder(to_onnx(weights))(np.unpackbits(bits, axis=1).reshape(-1, 64, 64))
    centroids, scatter = centroids_of(embeddings, plan_index + 1, PLANS + 1)
    trained = TrainedEncoder(
        TrainingSettings(objective="triplet", architecture=ARCHITECTURE),
        weights,
        centroids,
        *nearest_readout(centroids, scatter),
        np.zeros(PLANS, np.float32),
        (),
        np.empty(0, np.int32),
    )
    return build_memory(trained, [e.plan for e in experiences], "boxes")
