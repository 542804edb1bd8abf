"""Embeddings in two dimensions, on the axes along which they differ most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats, Floats32


class EmbeddingPlane(NamedTuple):
    """The plane of the two principal axes of some embeddings."""

    middle: Floats  # [D] mean of the embeddings
    axes: Floats  # [2, D] each of length 1; the largest number of an axis is positive
    share: float  # of the embeddings' variance that the plane shows

    def places(self, vectors: Floats32) -> Floats:
        """Where ``vectors [n, D]`` lie in the plane, ``[n, 2]``; NaN for a vector that is not finite."""
        finite = np.isfinite(vectors).all(axis=1, keepdims=True)
        flat = (np.where(finite, vectors, 0.0) - self.middle) @ self.axes.T
        return np.where(finite, flat, np.nan)


def embedding_plane(embeddings: Floats32) -> EmbeddingPlane:
    """The plane in which ``embeddings [n, D]`` differ most."""
    middle = embeddings.mean(0, dtype=np.float64)
    centred = embeddings - middle
    _, lengths, axes = np.linalg.svd(centred, full_matrices=False)
    largest = np.take_along_axis(axes, np.abs(axes).argmax(1)[:, np.newaxis], axis=1)
    variances = np.square(lengths)
    share = float(variances[:2].sum() / max(float(variances.sum()), 1e-12))
    return EmbeddingPlane(middle, (axes * np.sign(largest))[:2], share)


def spread_plans(count: int, most: int) -> list[int]:
    """At most ``most`` of ``count`` plans, spread evenly over all: those that a picture colours."""
    return [int(plan) for plan in np.linspace(0, count - 1, min(most, count))]


def axis_ends(values: Floats) -> tuple[float, float]:
    """Ends of an axis for ``values [n]``, beyond which one in a hundred may lie."""
    low, high = np.percentile(values, [0.5, 99.5])
    room = 0.08 * max(float(high - low), 1e-9)
    return float(low) - room, float(high) + room
