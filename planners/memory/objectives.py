"""What the encoder is trained for: triplets (the paper's), or which stored plans are free (the labels)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, linear, relu


class Objective(Protocol):
    """A loss over a batch, and how it ranks."""

    parameters: list[Tensor]  # of its own, trained with the encoder's; may be none

    def loss(self, embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Loss of embeddings ``[B, D]`` with origin rows ``[B]`` and free rows bool ``[B, N + 1]``."""

    def readout(self, embeddings: Tensor, rows: Tensor, count: int) -> tuple[Tensor, Tensor]:
        """Vectors ``[N + 1, D]`` and biases that score rows; may look at a sample ``[n, D]`` of training."""


class Labels:
    """Multi-label cross entropy: row i's logit is ``e . w_i + b_i``; row 0 says that no plan is free."""

    def __init__(self, rows: int, dimensions: int, rng: np.random.Generator, device: torch.device) -> None:
        vectors = rng.normal(0.0, dimensions**-0.5, (rows, dimensions)).astype(np.float32)
        self.vectors = torch.from_numpy(vectors).to(device)
        self.biases = torch.zeros(rows, device=device)
        self.parameters = [self.vectors, self.biases]

    def loss(self, embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Mean over problems of the sum over rows: a row is pulled alike however many plans there are."""
        logits = linear(embeddings, self.vectors, self.biases)
        losses = binary_cross_entropy_with_logits(logits, targets.to(torch.float32), reduction="none")
        return losses.sum(1).mean()

    def readout(self, embeddings: Tensor, rows: Tensor, count: int) -> tuple[Tensor, Tensor]:
        """What was learned."""
        return self.vectors.detach(), self.biases.detach()


class Triplet:
    """``max(|e(a) - e(s)| - |e(a) - e(d)| + margin, 0)``, the mean over all triplets of a batch.

    Anchor a and similar s share a plan: s was made for it, and it is free in a. In the dissimilar d that plan
    is known to be blocked (paper, III-C), and so is d's own plan in a: recall wants a nearer to the centroid
    of s than to that of d.
    """

    def __init__(self, margin: float) -> None:
        self.parameters: list[Tensor] = []
        self.margin = margin

    def loss(self, embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Mean over the triplets of a batch; zero where there are none."""
        distances = torch.cdist(embeddings, embeddings, compute_mode="donot_use_mm_for_euclid_dist")
        free = targets[:, rows]  # in the problem of the line, the plan that the problem of the column is for
        others = ~torch.eye(len(rows), dtype=torch.bool, device=rows.device)
        anchors, similar = (free & others).nonzero(as_tuple=True)
        dissimilar = ~free[anchors] & ~free[:, similar].T
        violations = relu(distances[anchors, similar][:, None] - distances[anchors] + self.margin)
        return (violations * dissimilar).sum() / dissimilar.sum().clamp(min=1)

    def readout(self, embeddings: Tensor, rows: Tensor, count: int) -> tuple[Tensor, Tensor]:
        """The sample's centroids, ranked by distance (``centroids.nearest_readout``)."""
        sizes = torch.bincount(rows, minlength=count)
        sums = embeddings.new_zeros((count, embeddings.shape[1])).index_add_(0, rows, embeddings)
        centroids = sums / sizes.clamp(min=1)[:, None]
        return centroids, torch.where(sizes > 0, -0.5 * centroids.square().sum(1), -torch.inf)
