"""Trains the network of ``learned``: obstacles such that a planner given them would have made the plan.

Nobody labels anything: the network proposes obstacles for a plan, a small differentiable planner improves the
plan among them, and the obstacles have to keep it as it is (LfLH, Wang et al. 2021). That planner takes a
fixed number of steps down a cost of smoothness and clearance, each preconditioned by the smoothness as in
CHOMP (Ratliff et al. 2009); without obstacles it ends near the straight line. It knows discs and points, no
kinodynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from planners.memory.encoder.adamw import AdamW, FlatParameters
from planners.memory.encoder.device import deterministic
from planners.memory.encoder.encoder import Weights
from planners.memory.hallucination.learned_obstacles import (
    CHANNELS,
    KERNEL,
    OBSTACLES,
    PLACE_STD_M,
    POINTS,
    RADIUS_M,
    RADIUS_STD,
    SMALLEST_STD,
    anchors_of,
    inputs_of,
    way_of,
    weight_shapes,
)
from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats, Floats32
from planners.world.randomness import generator

INITIAL_LOG_STD: Final = -1.0  # narrower than the prior: a plan is lost in what it draws


@dataclass(frozen=True)
class LearnedTraining:
    """How to train; losses are in square metres, averaged over points or obstacles."""

    steps: int = 300  # of Adam (Kingma and Ba 2015)
    batch: int = 32  # plans a step
    learning_rate: float = 3e-3
    planner_steps: int = 20  # unrolled
    planner_rate: float = 0.15  # of the way that a step goes back to the straight line
    push: float = 0.3  # how hard an obstacle pushes, against that
    margin_m: float = 1.5  # that the planner keeps from the discs
    body_m: float = 0.65  # that the plan's way is clear of the discs: half its sweep
    prior_weight: float = 0.05
    overlap_weight: float = 1.0  # of discs with each other
    plan_weight: float = 20.0  # of discs with the plan


def train_learned(
    experiences: Sequence[Experience], seed: int, settings: LearnedTraining | None = None
) -> Weights:
    """Weights of the network after training on N experiences; the same for the same seed."""
    settings = settings or LearnedTraining()
    ways = np.stack([way_of(experience.plan) for experience in experiences])
    rng = generator(seed, "learned")
    parameters = FlatParameters(_initial(rng), torch.device("cpu"))  # small: a GPU would be no faster
    optimiser = AdamW(parameters.values, weight_decay=0.0)
    smoothing = torch.from_numpy(_smoothing())
    with deterministic(1):
        for _ in range(settings.steps):
            rows = rng.integers(len(ways), size=min(settings.batch, len(ways)))
            noise = torch.from_numpy(rng.standard_normal((len(rows), OBSTACLES, 3)).astype(np.float32))
            loss = _loss(parameters.named(), ways[rows], noise, smoothing, settings)
            (gradient,) = torch.autograd.grad(loss, [parameters.values])
            optimiser.step(gradient, settings.learning_rate)
    return {name: value.detach().numpy() for name, value in parameters.named().items()}


def proposals(weights: dict[str, Tensor], inputs: Tensor) -> tuple[Tensor, Tensor]:
    """Raw means and deviations ``[n, K, 3]``, in those of the prior, for ways ``[n, 2, POINTS]``."""
    value = inputs
    for i in range(len(CHANNELS)):
        name = f"convolution.{i}"
        value = functional.conv1d(
            value, weights[f"{name}.weight"], weights[f"{name}.bias"], stride=2, padding=KERNEL // 2
        )
        value = functional.relu(value)
    raw = functional.linear(value.flatten(1), weights["linear.weight"], weights["linear.bias"])
    means, spreads = raw.view(-1, 2, OBSTACLES, 3).unbind(1)
    return means, SMALLEST_STD + torch.exp(spreads)


def planned(
    way: Tensor, centres: Tensor, radii: Tensor, smoothing: Tensor, settings: LearnedTraining
) -> Tensor:
    """What becomes of ways ``[n, POINTS, 2]`` among discs ``[n, K, 2]``, ``[n, K]``; their ends stay."""
    share = torch.linspace(0.0, 1.0, POINTS)[:, None]
    straight = way[:, :1] * (1.0 - share) + way[:, -1:] * share
    for _ in range(settings.planner_steps):
        apart = way[:, :, None] - centres[:, None]
        distance = torch.sqrt(apart.square().sum(3) + 1e-6)
        inside = functional.relu(radii[:, None] + settings.margin_m - distance)
        pushed = (inside / distance)[..., None] * apart
        step = settings.push * smoothing @ pushed.sum(2)
        way = way + settings.planner_rate * (straight - way) + step
    return way


def _loss(
    weights: dict[str, Tensor],
    ways: Floats,
    noise: Tensor,
    smoothing: Tensor,
    settings: LearnedTraining,
) -> Tensor:
    means, deviations = proposals(weights, torch.from_numpy(inputs_of(ways)))
    drawn = means + deviations * noise
    way = torch.from_numpy(ways.astype(np.float32))
    centres = torch.from_numpy(anchors_of(ways).astype(np.float32)) + PLACE_STD_M * drawn[..., :2]
    radii = RADIUS_M * torch.exp(RADIUS_STD * drawn[..., 2])
    made = planned(way, centres, radii, smoothing, settings)
    reconstruction = (made - way).square().sum(2).mean()
    prior = 0.5 * (means.square() + deviations.square() - 1.0).sum(2).mean() - deviations.log().sum(2).mean()
    between = torch.sqrt((centres[:, :, None] - centres[:, None]).square().sum(3) + 1e-6)
    overlap = functional.relu(radii[:, :, None] + radii[:, None] - between).square()
    overlap = torch.triu(overlap, 1).sum((1, 2)).mean() / OBSTACLES
    beside = torch.sqrt((centres[:, :, None] - way[:, None]).square().sum(3) + 1e-6).amin(2)
    blocked = functional.relu(radii + settings.body_m - beside).square().mean()
    return (
        reconstruction
        + settings.prior_weight * prior
        + settings.overlap_weight * overlap
        + settings.plan_weight * blocked
    )


def _smoothing() -> Floats32:
    """How far a push on one point moves the others ``[POINTS, POINTS]``: the inverse of an elastic band.

    Scaled so that no point moves by more than it is pushed; the two ends stay.
    """
    band = 2.0 * np.eye(POINTS - 2) - np.eye(POINTS - 2, k=1) - np.eye(POINTS - 2, k=-1)
    inverse = np.linalg.inv(band)
    full = np.zeros((POINTS, POINTS))
    full[1:-1, 1:-1] = inverse / inverse.max()
    return full.astype(np.float32)


def _initial(rng: np.random.Generator) -> Weights:
    """Normal weights scaled for ReLU (He et al. 2015), biases zero; a last layer that proposes the prior."""
    weights: Weights = {}
    for name, shape in weight_shapes().items():
        scale = 0.01 if name == "linear.weight" else np.sqrt(2.0 / np.prod(shape[1:]))
        values = np.zeros(shape) if name.endswith(".bias") else rng.normal(0.0, scale, shape)
        weights[name] = values.astype(np.float32)
    weights["linear.bias"][3 * OBSTACLES :] = INITIAL_LOG_STD
    return weights
