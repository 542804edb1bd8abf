"""What the encoder is trained for: triplets, as in the paper, or labels, which say which plans are free."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, linear, relu

from planners.memory.encoder.encoder import Weights
from planners.memory.ranking.readout import centroids_of, nearest_readout

VECTORS = "readout.vectors"
BIASES = "readout.biases"


class Labels:
    """Logits ``e . w_i + b_i``, with row 0 for "no plan is free", trained for three things at once.

    The loss sums up the cross entropy of each row, for which plans are free; minus the logarithm of the share
    of the free rows in the softmax, so that a free plan comes first; and the cross entropy of the softmax, so
    that the plan for which a problem was made comes first. What a plan's blocked cells tell is added to its
    logit beforehand (``cell_masks.CELL_SCORES``), so the encoder learns what they do not tell. Half of each
    embedding is dropped while learning: without that it ranks worse in worlds that it never saw
    (docs/studies/encoder-and-mask.md).
    """

    def __init__(self, first_weight: float, origin_weight: float, by_cells: bool = True) -> None:
        self.by_cells = by_cells
        self.dropout = 0.5 if by_cells else 0.0  # share of an embedding's numbers (Srivastava et al. 2014)
        self.first_weight = first_weight
        self.origin_weight = origin_weight

    def initial(self, rows: int, dimensions: int, rng: np.random.Generator) -> Weights:
        """Draw random vectors; biases are zero."""
        vectors = rng.normal(0.0, dimensions**-0.5, (rows, dimensions)).astype(np.float32)
        return {VECTORS: vectors, BIASES: np.zeros(rows, np.float32)}

    def loss(
        self,
        own: Mapping[str, Tensor],
        embeddings: Tensor,
        rows: Tensor,
        targets: Tensor,
        known: Tensor | float = 0.0,
    ) -> Tensor:
        """Compute the loss of a batch, the mean over problems of the sum over rows.

        Args:
            own: the objective's own parameters.
            embeddings: ``[B, D]`` of the batch.
            rows: ``[B]`` the row of the plan that each problem was made for, -1 for none.
            targets: bool ``[B, N + 1]`` which rows are free.
            known: ``[B, N + 1]`` what blocked cells add to each logit.
        """
        logits = linear(embeddings, own[VECTORS], own[BIASES]) + known
        wanted = targets.to(logits.dtype)
        loss = binary_cross_entropy_with_logits(logits, wanted, reduction="none").sum(1)
        whole = torch.logsumexp(logits, 1)
        free = torch.logsumexp(logits.masked_fill(~targets, -torch.inf), 1)
        origin = (whole - logits.gather(1, rows.clamp(min=0)[:, None])[:, 0]) * (rows >= 0)
        return (loss + self.first_weight * (whole - free) + self.origin_weight * origin).mean()

    def readout(
        self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, count: int
    ) -> tuple[Tensor, Tensor]:
        """Return the learned vectors and biases."""
        return own[VECTORS], own[BIASES]


class Triplet:
    """The mean of ``max(|e(a) - e(s)| - |e(a) - e(d)| + margin, 0)`` over all triplets of a batch.

    The anchor a and the similar s share a plan: s was made for it, and it is free in a. In the dissimilar d
    that plan is blocked (paper, III-C), and so is d's own plan, if it has one, in a: recall needs a to be
    nearer to the centroid of s than to that of d. If ``semi_hard`` is set, only those d count that are
    farther than s, but by less than the margin (Schroff, Kalenichenko and Philbin 2015). With ``own_anchors``
    the anchor was made for the plan, too, and nothing is asked of d's own plan: exactly the paper's triplets.
    """

    by_cells = False
    dropout = 0.0

    def __init__(self, margin: float, semi_hard: bool = False, own_anchors: bool = False) -> None:
        self.margin = margin
        self.semi_hard = semi_hard
        self.own_anchors = own_anchors

    def initial(self, rows: int, dimensions: int, rng: np.random.Generator) -> Weights:
        """Return no parameters."""
        return {}

    def loss(
        self,
        own: Mapping[str, Tensor],
        embeddings: Tensor,
        rows: Tensor,
        targets: Tensor,
        known: Tensor | float = 0.0,
    ) -> Tensor:
        """Average over the triplets of a batch; zero if there are none. Cells do not count."""
        distances = torch.cdist(embeddings, embeddings, compute_mode="donot_use_mm_for_euclid_dist")
        # whether the plan that the problem of the column was made for is free in the problem of the row
        free = targets[:, rows.clamp(min=0)] & (rows >= 0)
        others = ~torch.eye(len(rows), dtype=torch.bool, device=rows.device)
        if self.own_anchors:
            same_plan = (rows[:, None] == rows) & (rows >= 0)
            anchors, similar = (same_plan & others).nonzero(as_tuple=True)
            dissimilar = ~free[:, similar].T
        else:
            anchors, similar = (free & others).nonzero(as_tuple=True)
            dissimilar = ~free[anchors] & ~free[:, similar].T
        excess = distances[anchors, similar][:, None] - distances[anchors]
        if self.semi_hard:
            dissimilar &= (excess < 0.0) & (excess > -self.margin)
        return (relu(excess + self.margin) * dissimilar).sum() / dissimilar.sum().clamp(min=1)

    def readout(
        self, own: Mapping[str, Tensor], embeddings: Tensor, rows: Tensor, count: int
    ) -> tuple[Tensor, Tensor]:
        """Rank by the distance to the centroids of the sample."""
        centroids, _ = centroids_of(embeddings.cpu().numpy(), rows.cpu().numpy(), count)
        vectors, biases = (torch.from_numpy(each) for each in nearest_readout(centroids, 0.0))
        return vectors.to(embeddings.device), biases.to(embeddings.device)


Objective = Labels | Triplet
