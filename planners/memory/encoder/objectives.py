"""What the encoder is trained for: triplets (the paper's), or which stored plans are free (the labels)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, linear, relu

from planners.memory.encoder.encoder import Weights
from planners.memory.ranking.readout import centroids_of, nearest_readout

VECTORS = "readout.vectors"
BIASES = "readout.biases"


class Objective(Protocol):
    """A loss over a batch, and how it ranks."""

    def initial(self, rows: int, dimensions: int, rng: np.random.Generator) -> Weights:
        """Parameters of its own to begin with, trained with the encoder's; may be none."""

    def loss(self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Loss of embeddings ``[B, D]``: free rows bool ``[B, N + 1]``, origin rows ``[B]``, -1: none."""

    def readout(
        self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, count: int
    ) -> tuple[Tensor, Tensor]:
        """Vectors ``[N + 1, D]`` and biases that score rows; may look at a sample ``[n, D]`` of training."""


class Labels:
    """Logits ``e . w_i + b_i``, row 0 for "no plan is free", trained for three things at once.

    Which plans are free: cross entropy of each. That a free one comes first: minus the logarithm of the share
    of the softmax that the free rows have. And that the origin does: cross entropy of the softmax.
    """

    def __init__(self, first_weight: float, origin_weight: float) -> None:
        self.first_weight = first_weight
        self.origin_weight = origin_weight

    def initial(self, rows: int, dimensions: int, rng: np.random.Generator) -> Weights:
        """Random vectors, no biases."""
        vectors = rng.normal(0.0, dimensions**-0.5, (rows, dimensions)).astype(np.float32)
        return {VECTORS: vectors, BIASES: np.zeros(rows, np.float32)}

    def loss(self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Mean over problems of the sum over rows: a row is pulled alike however many plans there are."""
        logits = linear(embeddings, own[VECTORS], own[BIASES])
        wanted = targets.to(logits.dtype)
        loss = binary_cross_entropy_with_logits(logits, wanted, reduction="none").sum(1)
        whole = torch.logsumexp(logits, 1)
        free = torch.logsumexp(logits.masked_fill(~targets, -torch.inf), 1)
        origin = (whole - logits.gather(1, rows.clamp(min=0)[:, None])[:, 0]) * (rows >= 0)
        return (loss + self.first_weight * (whole - free) + self.origin_weight * origin).mean()

    def readout(
        self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, count: int
    ) -> tuple[Tensor, Tensor]:
        """What was learned."""
        return own[VECTORS], own[BIASES]


class Triplet:
    """``max(|e(a) - e(s)| - |e(a) - e(d)| + margin, 0)``, the mean over all triplets of a batch.

    Anchor a and similar s share a plan: s was made for it, and it is free in a. In the dissimilar d that plan
    is known to be blocked (paper, III-C), and so is d's own plan in a, if it has one: recall wants a nearer
    to the centroid of s than to that of d. ``semi_hard``: only those d that are farther than s, but by less
    than the margin (Schroff, Kalenichenko and Philbin 2015).
    """

    def __init__(self, margin: float, semi_hard: bool = False) -> None:
        self.margin = margin
        self.semi_hard = semi_hard

    def initial(self, rows: int, dimensions: int, rng: np.random.Generator) -> Weights:
        """No parameters."""
        return {}

    def loss(self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Mean over the triplets of a batch; zero where there are none."""
        distances = torch.cdist(embeddings, embeddings, compute_mode="donot_use_mm_for_euclid_dist")
        # in the problem of the line, the plan that the problem of the column was made for, if any
        free = targets[:, rows.clamp(min=0)] & (rows >= 0)
        others = ~torch.eye(len(rows), dtype=torch.bool, device=rows.device)
        anchors, similar = (free & others).nonzero(as_tuple=True)
        dissimilar = ~free[anchors] & ~free[:, similar].T
        excess = distances[anchors, similar][:, None] - distances[anchors]
        if self.semi_hard:
            dissimilar &= (excess < 0.0) & (excess > -self.margin)
        return (relu(excess + self.margin) * dissimilar).sum() / dissimilar.sum().clamp(min=1)

    def readout(
        self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, count: int
    ) -> tuple[Tensor, Tensor]:
        """The sample's centroids, ranked by distance."""
        centroids, _ = centroids_of(embeddings.cpu().numpy(), rows.cpu().numpy(), count)
        vectors, biases = (torch.from_numpy(each) for each in nearest_readout(centroids, 0.0))
        return vectors.to(embeddings.device), biases.to(embeddings.device)
