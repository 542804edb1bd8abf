"""Trains the network of ``learned`` to propose obstacles that would have made a planner find the plan.

No labels are needed: the network proposes obstacles for a plan, a small differentiable planner improves the
plan among them, and the loss is how much the plan changes (LfLH, Wang et al. 2021). That planner takes a
fixed number of steps down a cost of smoothness and clearance, each preconditioned by the smoothness as in
CHOMP (Ratliff et al. 2009). Without obstacles it ends near the straight line. It plans for points among discs
and ignores kinodynamics.
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
from planners.memory.hallucination import learned_obstacles as learned
from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats, Floats32
from planners.world.randomness import generator

INITIAL_LOG_STD: Final = -1.0  # narrower than the prior, whose draws would bury the plan


@dataclass(frozen=True)
class LearnedTraining:
    """Settings of the training. Losses are in square metres, averaged over points or obstacles."""

    steps: int = 300  # of Adam (Kingma and Ba 2015)
    batch: int = 32  # plans a step
    learning_rate: float = 3e-3
    planner_steps: int = 20  # unrolled
    planner_rate: float = 0.15  # share of the offset from the straight line that a step takes back
    push: float = 0.3  # how hard an obstacle pushes against that
    margin_m: float = 1.5  # that the planner keeps from the discs
    body_m: float = 0.65  # that discs should keep from the plan's path: half of its sweep
    prior_weight: float = 0.05
    overlap_weight: float = 1.0  # of discs with each other
    plan_weight: float = 20.0  # of discs with the plan


def train_learned(
    experiences: Sequence[Experience], seed: int, settings: LearnedTraining | None = None
) -> Weights:
    """Train the network on N experiences, and return its weights: the same ones for the same seed."""
    settings = settings or LearnedTraining()
    paths = np.stack([learned.path_of(experience.plan) for experience in experiences])
    rng = generator(seed, "learned")
    parameters = FlatParameters(_initial(rng), torch.device("cpu"))  # so small that a GPU would be no faster
    optimiser = AdamW(parameters.values, weight_decay=0.0)
    smoothing = torch.from_numpy(_smoothing())
    with deterministic(1):
        for _ in range(settings.steps):
            rows = rng.integers(len(paths), size=min(settings.batch, len(paths)))
            normal = rng.standard_normal((len(rows), learned.OBSTACLES, 3))
            noise = torch.from_numpy(normal.astype(np.float32))
            loss = _loss(parameters.named(), paths[rows], noise, smoothing, settings)
            (gradient,) = torch.autograd.grad(loss, [parameters.values])
            optimiser.step(gradient, settings.learning_rate)
    return {name: value.detach().numpy() for name, value in parameters.named().items()}


def proposals(weights: dict[str, Tensor], inputs: Tensor) -> tuple[Tensor, Tensor]:
    """Run the network on ``inputs [n, 2, POINTS]``: means and deviations ``[n, K, 3]`` in prior units."""
    value = inputs
    for i in range(len(learned.CHANNELS)):
        name = f"convolution.{i}"
        value = functional.conv1d(
            value, weights[f"{name}.weight"], weights[f"{name}.bias"], stride=2, padding=learned.KERNEL // 2
        )
        value = functional.relu(value)
    raw = functional.linear(value.flatten(1), weights["linear.weight"], weights["linear.bias"])
    means, spreads = raw.view(-1, 2, learned.OBSTACLES, 3).unbind(1)
    return means, learned.SMALLEST_STD + torch.exp(spreads)


def planned(
    path: Tensor, centres: Tensor, radii: Tensor, smoothing: Tensor, settings: LearnedTraining
) -> Tensor:
    """Plan from paths ``[n, POINTS, 2]``, whose ends stay, among discs ``[n, K, 2]`` of radii ``[n, K]``."""
    share = torch.linspace(0.0, 1.0, learned.POINTS)[:, None]
    straight = path[:, :1] * (1.0 - share) + path[:, -1:] * share
    for _ in range(settings.planner_steps):
        apart = path[:, :, None] - centres[:, None]
        distance = torch.sqrt(apart.square().sum(3) + 1e-6)
        inside = functional.relu(radii[:, None] + settings.margin_m - distance)
        pushed = (inside / distance)[..., None] * apart
        step = settings.push * smoothing @ pushed.sum(2)
        path = path + settings.planner_rate * (straight - path) + step
    return path


def _loss(
    weights: dict[str, Tensor], paths: Floats, noise: Tensor, smoothing: Tensor, settings: LearnedTraining
) -> Tensor:
    means, deviations = proposals(weights, torch.from_numpy(learned.inputs_of(paths)))
    drawn = means + deviations * noise
    path = torch.from_numpy(paths.astype(np.float32))
    anchors = torch.from_numpy(learned.anchors_of(paths).astype(np.float32))
    centres = anchors + learned.PLACE_STD_M * drawn[..., :2]
    radii = learned.RADIUS_M * torch.exp(learned.RADIUS_STD * drawn[..., 2])
    made = planned(path, centres, radii, smoothing, settings)
    reconstruction = (made - path).square().sum(2).mean()
    prior = 0.5 * (means.square() + deviations.square() - 1.0).sum(2).mean() - deviations.log().sum(2).mean()
    between = torch.sqrt((centres[:, :, None] - centres[:, None]).square().sum(3) + 1e-6)
    overlap = functional.relu(radii[:, :, None] + radii[:, None] - between).square()
    overlap = torch.triu(overlap, 1).sum((1, 2)).mean() / learned.OBSTACLES
    beside = torch.sqrt((centres[:, :, None] - path[:, None]).square().sum(3) + 1e-6).amin(2)
    blocked = functional.relu(radii + settings.body_m - beside).square().mean()
    return (
        reconstruction
        + settings.prior_weight * prior
        + settings.overlap_weight * overlap
        + settings.plan_weight * blocked
    )


def _smoothing() -> Floats32:
    """How far a push on one point moves the others ``[POINTS, POINTS]``: the inverse of an elastic band.

    It is scaled so that no point moves farther than it is pushed. The two ends stay.
    """
    size = learned.POINTS - 2
    band = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    inverse = np.linalg.inv(band)
    full = np.zeros((learned.POINTS, learned.POINTS))
    full[1:-1, 1:-1] = inverse / inverse.max()
    return full.astype(np.float32)


def _initial(rng: np.random.Generator) -> Weights:
    """Normal weights scaled for ReLU (He et al. 2015), zero biases, a last layer that proposes the prior."""
    weights: Weights = {}
    for name, shape in learned.weight_shapes().items():
        scale = 0.01 if name == "linear.weight" else np.sqrt(2.0 / np.prod(shape[1:]))
        values = np.zeros(shape) if name.endswith(".bias") else rng.normal(0.0, scale, shape)
        weights[name] = values.astype(np.float32)
    weights["linear.bias"][3 * learned.OBSTACLES :] = INITIAL_LOG_STD
    return weights
