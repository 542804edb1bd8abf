"""Trains an encoder on a set of problems, an epoch at a time."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from planners.memory.encoder.adamw import AdamW, FlatParameters, one_cycle
from planners.memory.encoder.encoder import Weights
from planners.memory.encoder.objectives import Objective
from planners.memory.encoder.torch_network import embed, embed_all
from planners.memory.plans.cell_masks import CELL_SCORES, count_blocked_cells
from planners.world.arrays import Flags, Floats32, Integers
from planners.world.geometry.occupancy import GRID, Bits, Grid, bits_of

LearnerState = tuple[Floats32, Floats32, Floats32, Floats32]


class Learner:
    """Learns from n problems: packed grids ``[n, 512]``, origin rows ``[n]``, free rows ``[n, N + 1]``."""

    def __init__(
        self,
        problems: tuple[Grid, Integers, Flags],
        masks: Bits,
        weights: Weights,
        own: Weights,
        weight_decay: float,
        device: torch.device,
    ) -> None:
        """Begin with ``weights`` of the encoder and the ``own`` parameters of an objective.

        ``masks [N, 64]`` are the cells that each plan sweeps.
        """
        grids, rows, free = problems
        self._grids, self._masks = grids, masks
        self._bits = torch.from_numpy(np.ascontiguousarray(grids)).to(device)
        self._rows = torch.from_numpy(rows.astype(np.int64)).to(device)
        self._free = torch.from_numpy(free).to(device)
        self._parameters = FlatParameters(weights | own, device)
        self._optimiser = AdamW(self._parameters.values, weight_decay)
        self._best = self._parameters.values.detach().clone()

    def epoch(self, objective: Objective, order: Integers, batch: int, steps: int, rate: float) -> float:
        """Learn from the problems ``order [n]`` in batches, and return the mean loss.

        ``rate`` is the highest learning rate of a schedule over ``steps`` in all.
        """
        losses = []
        rng = torch.Generator(self._bits.device).manual_seed(self._optimiser.steps)
        for first in range(0, len(order), batch):
            problems = order[first : first + batch]
            part = torch.from_numpy(problems).to(self._bits.device)
            named = self._parameters.named()
            embeddings = embed(named, self._bits[part])
            if objective.dropout:
                kept = torch.rand(embeddings.shape, generator=rng, device=embeddings.device)
                embeddings = embeddings * (kept >= objective.dropout) / (1.0 - objective.dropout)
            known = self._known(objective, problems)
            loss = objective.loss(named, embeddings, self._rows[part], self._free[part], known)
            (gradient,) = torch.autograd.grad(loss, self._parameters.values)
            self._optimiser.step(gradient, one_cycle(self._optimiser.steps, steps, rate))
            losses.append(loss.detach())
        return float(torch.stack(losses).mean())

    @torch.no_grad()
    def scores(self, objective: Objective, problems: Integers, sample: Integers) -> Floats32:
        """Score all plans ``[m, N]`` for ``problems [m]``. A readout may be made from those of ``sample``."""
        named = self._parameters.named()
        embeddings = embed_all(named, self._bits[sample])
        rows = self._rows[sample]
        vectors, biases = objective.readout(named, embeddings, rows, self._free.shape[1])
        scores = embed_all(named, self._bits[problems]) @ vectors.T + biases
        scores += self._known(objective, problems)
        return _array(scores[:, 1:])

    def _known(self, objective: Objective, problems: Integers) -> Tensor:
        """What blocked cells add to the scores of ``problems [m]``: ``[m, N + 1]``."""
        known = np.zeros((len(problems), len(self._masks) + 1), np.float32)
        if objective.by_cells:
            blocked = np.empty((len(problems), len(self._masks)), np.int32)
            grids = np.unpackbits(self._grids[problems], axis=1).reshape(-1, GRID, GRID)
            count_blocked_cells(self._masks, bits_of(grids), blocked)
            known[:, 1:] = CELL_SCORES[blocked]
        return torch.from_numpy(known).to(self._bits.device)

    def keep(self) -> None:
        """Keep the present parameters as the best so far."""
        self._best = self._parameters.values.detach().clone()

    def best(self) -> Weights:
        """Return the parameters that were kept, with those of the objective."""
        return {name: _array(value) for name, value in self._parameters.named(self._best).items()}

    def best_embeddings(self, problems: Integers) -> Floats32:
        """Embed ``problems [m]`` with the parameters that were kept: ``[m, D]``."""
        return _array(embed_all(self._parameters.named(self._best), self._bits[problems]))

    def state(self) -> LearnerState:
        """Copy all that changes while learning, ``[P]`` each: parameters, the optimiser's means, the best."""
        values, mean, square, best = map(_array, self._state())
        return values, mean, square, best

    def restore(self, state: LearnerState, steps: int) -> None:
        """Restore a ``state`` that was reached after so many steps.

        Raises ValueError if it is of another network.
        """
        if any(kept.shape != self._best.shape for kept in state):
            raise ValueError(
                f"checkpoint has {[len(kept) for kept in state]} parameters, expected {len(self._best)}: "
                "was it made with the same settings?"
            )
        with torch.no_grad():
            for tensor, kept in zip(self._state(), state, strict=True):
                tensor.copy_(torch.from_numpy(kept))
        self._optimiser.steps = steps

    def _state(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        return self._parameters.values, self._optimiser.mean, self._optimiser.square, self._best


def _array(tensor: Tensor) -> Floats32:
    array: Floats32 = tensor.detach().cpu().numpy().copy()
    return array
