"""An encoder that learns: parameters, optimiser and objective over a set of problems, an epoch at a time."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from planners.memory.encoder.adamw import AdamW, FlatParameters, one_cycle
from planners.memory.encoder.device import forward_on
from planners.memory.encoder.encoder import Weights
from planners.memory.encoder.objectives import Objective
from planners.memory.encoder.torch_network import embed_all
from planners.world.arrays import Flags, Floats32, Integers
from planners.world.geometry.occupancy import Grid

LearnerState = tuple[Floats32, Floats32, Floats32, Floats32]


class Learner:
    """Learns from n problems: packed grids ``[n, 512]``, origin rows ``[n]``, free rows ``[n, N + 1]``."""

    def __init__(
        self,
        problems: tuple[Grid, Integers, Flags],
        weights: Weights,
        own: Weights,
        weight_decay: float,
        device: torch.device,
    ) -> None:
        """``weights`` of the encoder and an objective's ``own`` parameters are what it begins with."""
        grids, rows, free = problems
        self._bits = torch.from_numpy(np.ascontiguousarray(grids)).to(device)
        self._rows = torch.from_numpy(rows.astype(np.int64)).to(device)
        self._free = torch.from_numpy(free).to(device)
        self._parameters = FlatParameters(weights | own, device)
        self._optimiser = AdamW(self._parameters.values, weight_decay)
        self._forward = forward_on(device)
        self._best = self._parameters.values.detach().clone()

    def epoch(self, objective: Objective, order: Integers, batch: int, steps: int, rate: float) -> float:
        """Learn from the problems ``order`` in batches; the mean loss.

        ``rate`` is the highest of a schedule over ``steps`` in all.
        """
        losses = []
        for part in torch.split(torch.from_numpy(order).to(self._bits.device), batch):
            named = self._parameters.named()
            embeddings = self._forward(named, self._bits[part])
            loss = objective.loss(named, embeddings, self._rows[part], self._free[part])
            (gradient,) = torch.autograd.grad(loss, self._parameters.values)
            self._optimiser.step(gradient, one_cycle(self._optimiser.steps, steps, rate))
            losses.append(loss.detach())
        return float(torch.stack(losses).mean())

    @torch.no_grad()
    def scores(self, objective: Objective, asked: Integers, sample: Integers) -> Floats32:
        """Scores ``[len(asked), N]`` of all plans; ``sample``: problems that a readout may be made from."""
        named = self._parameters.named()
        embeddings = embed_all(named, self._bits[sample])
        rows = self._rows[sample]
        vectors, biases = objective.readout(named, embeddings, rows, self._free.shape[1])
        return _array((embed_all(named, self._bits[asked]) @ vectors.T + biases)[:, 1:])

    def keep(self) -> None:
        """Remember the parameters as the best so far."""
        self._best = self._parameters.values.detach().clone()

    def best(self) -> Weights:
        """The parameters that were kept, the objective's own among them."""
        return {name: _array(value) for name, value in self._parameters.named(self._best).items()}

    def best_embeddings(self, asked: Integers) -> Floats32:
        """Embeddings ``[len(asked), D]`` by the parameters that were kept."""
        return _array(embed_all(self._parameters.named(self._best), self._bits[asked]))

    def state(self) -> LearnerState:
        """All that changes while learning, ``[P]`` each: parameters, the optimiser's two means, the best."""
        values, mean, square, best = map(_array, self._places())
        return values, mean, square, best

    def restore(self, state: LearnerState, steps: int) -> None:
        """Take a ``state`` back, reached after so many steps; ValueError where it is another network's."""
        if any(kept.shape != self._best.shape for kept in state):
            raise ValueError(
                f"checkpoint has {[len(kept) for kept in state]} parameters, wanted were {len(self._best)}: "
                "was it made with the same settings?"
            )
        with torch.no_grad():
            for place, kept in zip(self._places(), state, strict=True):
                place.copy_(torch.from_numpy(kept))
        self._optimiser.steps = steps

    def _places(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        return self._parameters.values, self._optimiser.mean, self._optimiser.square, self._best


def _array(tensor: Tensor) -> Floats32:
    array: Floats32 = tensor.detach().cpu().numpy().copy()
    return array
