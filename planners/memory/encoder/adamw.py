"""AdamW over one flat vector, and its learning rate. Torch's optimisers take seconds to import."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
import torch
from torch import Tensor

from planners.world.arrays import Floats32

BETAS: Final = (0.9, 0.999)  # decay of the gradient's and of its square's running means
EPSILON: Final = 1e-8
WARM_UP: Final = 0.3  # share of the steps in which the learning rate rises
FIRST_SHARE: Final = 1 / 25  # the first rate, as a share of the highest


class FlatParameters:
    """Named arrays as views of one vector, so that a step of the optimiser takes a handful of operations."""

    def __init__(self, arrays: Mapping[str, Floats32], device: torch.device) -> None:
        self._shapes = {name: array.shape for name, array in arrays.items()}
        flat = np.concatenate([array.ravel() for array in arrays.values()])
        self.values = torch.from_numpy(flat).to(device).requires_grad_(True)

    def named(self, values: Tensor | None = None) -> dict[str, Tensor]:
        """Return the parameters by name: these, or others ``values [P]`` of the same shapes."""
        sizes = [math.prod(shape) for shape in self._shapes.values()]
        parts = torch.split(self.values if values is None else values, sizes)
        return {
            name: part.view(shape) for (name, shape), part in zip(self._shapes.items(), parts, strict=True)
        }


class AdamW:
    """Adam with decoupled weight decay (Loshchilov and Hutter 2019), for all parameters at once."""

    def __init__(self, values: Tensor, weight_decay: float) -> None:
        self.values = values
        self.weight_decay = weight_decay
        self.mean = torch.zeros_like(values, requires_grad=False)
        self.square = torch.zeros_like(values, requires_grad=False)
        self.steps = 0

    @torch.no_grad()
    def step(self, gradient: Tensor, rate: float) -> None:
        """Move the values against the gradient ``[P]``."""
        self.steps += 1
        self.mean.lerp_(gradient, 1.0 - BETAS[0])
        self.square.mul_(BETAS[1]).addcmul_(gradient, gradient, value=1.0 - BETAS[1])
        self.values.mul_(1.0 - rate * self.weight_decay)
        scale = (self.square / (1.0 - BETAS[1] ** self.steps)).sqrt_().add_(EPSILON)
        self.values.addcdiv_(self.mean, scale, value=-rate / (1.0 - BETAS[0] ** self.steps))


def one_cycle(step: int, steps: int, highest: float) -> float:
    """Return the rate of step 0 .. steps - 1: along cosines up to ``highest`` and down to 0 (Smith 2018)."""
    rising = WARM_UP * steps
    if step < rising:
        lowest = FIRST_SHARE * highest
        return lowest + (highest - lowest) * (1.0 - math.cos(math.pi * step / rising)) / 2.0
    return highest * (1.0 + math.cos(math.pi * (step - rising) / (steps - rising))) / 2.0
