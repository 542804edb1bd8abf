"""What the encoder is trained for: triplets (the paper's), or which stored plans are free (the labels)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, linear, relu

from planners.world.problem import Integers


class Objective(Protocol):
    """A loss over a batch, the batches it wants, and how it ranks."""

    parameters: list[Tensor]  # of its own, trained with the encoder's; may be none

    def epoch(self, plan_index: Integers, rng: np.random.Generator) -> Integers:
        """Problem indices in the order in which an epoch's batches take them."""

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

    def epoch(self, plan_index: Integers, rng: np.random.Generator) -> Integers:
        """Every problem once."""
        return rng.permutation(len(plan_index)).astype(np.int32)

    def loss(self, embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Mean over problems of the sum over rows: a row is pulled alike however many plans there are."""
        logits = linear(embeddings, self.vectors, self.biases)
        losses = binary_cross_entropy_with_logits(logits, targets.to(torch.float32), reduction="none")
        return losses.sum(1).mean()

    def readout(self, embeddings: Tensor, rows: Tensor, count: int) -> tuple[Tensor, Tensor]:
        """What was learned."""
        return self.vectors.detach(), self.biases.detach()


class Triplet:
    """``max(|e(a) - e(s)| - |e(a) - e(d)| + margin, 0)``.

    Anchor a and similar s are from one plan, dissimilar d is a problem that the plan does not solve. A batch
    is made of pairs (a, s), and each pair's d are all problems of the batch in which its plan is known not to
    be free. The mean is taken over the triplets that still violate the margin.
    """

    def __init__(self, margin: float) -> None:
        self.parameters: list[Tensor] = []
        self.margin = margin

    def epoch(self, plan_index: Integers, rng: np.random.Generator) -> Integers:
        """Every problem once (but for a plan's odd one), pairs of one plan next to each other."""
        order = rng.permutation(len(plan_index))
        order = order[np.argsort(plan_index[order], kind="stable")]
        pairs = []
        for group in np.split(order, np.flatnonzero(np.diff(plan_index[order])) + 1):
            pairs.append(group[: len(group) // 2 * 2].reshape(-1, 2))
        return rng.permutation(np.concatenate(pairs)).ravel().astype(np.int32)

    def loss(self, embeddings: Tensor, rows: Tensor, targets: Tensor) -> Tensor:
        """Mean over the violating triplets of a batch of pairs."""
        anchors, similar = embeddings[0::2], embeddings[1::2]
        pull = (anchors - similar).square().sum(1).add(1e-12).sqrt()
        push = torch.cdist(anchors, embeddings, compute_mode="donot_use_mm_for_euclid_dist")
        violations = relu(pull[:, None] - push + self.margin) * negatives(rows[0::2], targets)
        return violations.sum() / (violations.detach() > 0.0).sum().clamp(min=1)

    def readout(self, embeddings: Tensor, rows: Tensor, count: int) -> tuple[Tensor, Tensor]:
        """The sample's centroids, ranked by distance (``centroids.nearest_readout``)."""
        sizes = torch.bincount(rows, minlength=count)
        sums = embeddings.new_zeros((count, embeddings.shape[1])).index_add_(0, rows, embeddings)
        centroids = sums / sizes.clamp(min=1)[:, None]
        return centroids, torch.where(sizes > 0, -0.5 * centroids.square().sum(1), -torch.inf)


def negatives(rows: Tensor, targets: Tensor) -> Tensor:
    """Which problems may be dissimilar to anchors of ``rows [A]``, known not free there: bool ``[A, B]``.

    Row 0 is "free" where no plan is, so problems that some plan solves are dissimilar to those of ``S_0``.
    """
    return ~targets[:, rows].T
