"""Learned: obstacles drawn from distributions that a network proposes for the plan, without torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from planners.memory.encoder.encoder import Weights
from planners.memory.hallucination.method import DrawObstacles, Sampler
from planners.memory.hallucination.placing import clear_of, corridor_of, with_clear
from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats, Floats32
from planners.world.classes.shapes import add_regular, finished, new_canvas
from planners.world.jit import jit
from planners.world.problem import Obstacles, Plan

POINTS: Final = 32  # to which a plan is resampled, evenly spaced along its path
OBSTACLES: Final = 8  # proposed for a plan
CHANNELS: Final = (16, 32, 64)  # of the convolutions along the plan
KERNEL: Final = 5  # points wide; stride 2
PLACE_STD_M: Final = 4.0  # prior: of an obstacle's distance from its point of the plan, in x and in y
RADIUS_M: Final = 2.0  # prior: median radius
RADIUS_STD: Final = 0.4  # prior: of the logarithm of the radius
SMALLEST_STD: Final = 0.05  # of a proposal, in units of the prior's


def weight_shapes() -> dict[str, tuple[int, ...]]:
    """Return the shapes of the network: three convolutions along the plan, then one layer."""
    shapes: dict[str, tuple[int, ...]] = {}
    inputs = 2
    for i, outputs in enumerate(CHANNELS):
        shapes[f"convolution.{i}.weight"] = (outputs, inputs, KERNEL)
        shapes[f"convolution.{i}.bias"] = (outputs,)
        inputs = outputs
    shapes["linear.weight"] = (2 * OBSTACLES * 3, inputs * POINTS // 2 ** len(CHANNELS))
    shapes["linear.bias"] = (2 * OBSTACLES * 3,)
    return shapes


class Proposal(NamedTuple):
    """Normal distributions of a plan's obstacles: centre x, y (m), and logarithm of the radius (m)."""

    means: Floats  # [K, 3]
    deviations: Floats  # [K, 3]


@dataclass(frozen=True, eq=False)
class Learned:
    """Draw obstacles that would have made a planner find this plan (LfLH).

    After Wang, Xiao, Nettekoven, Umasankar, Singh, Bommakanti, Topcu and Stone 2021. The network is trained
    by ``train_learned``. The obstacles are regular polygons, made small enough to stay out of the plan's
    sweep. The others are those of a new draw of the class that are clear of the plan.
    """

    weights: Weights
    smallest_m: float = 0.3  # radius; smaller polygons are left out
    near_m: float = 0.3  # distance that obstacles of the class keep from the sweep

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Have the network propose distributions for the plan."""
        corridor = corridor_of(experience)
        boxes = np.concatenate([experience.boxes.reshape(-1, 6), corridor.goal.reshape(-1, 6)])
        means, deviations = propose(self.weights, experience.plan)

        def sample(draw: DrawObstacles, rng: np.random.Generator) -> Obstacles:
            drawn = means + deviations * rng.standard_normal(means.shape)
            return with_clear(_polygons(drawn, boxes, self.smallest_m, rng), draw(rng), corridor, self.near_m)

        return sample


def path_of(plan: Plan) -> Floats:
    """Return positions ``[POINTS, 2]`` in metres, evenly spaced along a plan's path."""
    positions = plan.states[:, :2]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(positions, axis=0).T))])
    at = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(at, along, positions[:, k]) for k in range(2)])


def anchors_of(paths: Floats) -> Floats:
    """Return the points ``[..., K, 2]`` of paths ``[..., POINTS, 2]`` to which the K obstacles belong."""
    return paths[..., POINTS // OBSTACLES // 2 :: POINTS // OBSTACLES, :]


def inputs_of(paths: Floats) -> Floats32:
    """Make the network's inputs ``[..., 2, POINTS]`` of paths ``[..., POINTS, 2]`` in metres.

    They say, in tens of metres, how far along the diagonal from start to goal a point is, and how far beside.
    """
    x, y = np.moveaxis(paths, -1, 0)
    scaled: Floats32 = (np.stack([x + y - 50.0, y - x], axis=-2) / np.sqrt(200.0)).astype(np.float32)
    return scaled


def propose(weights: Weights, plan: Plan) -> Proposal:
    """Run the network on a plan. ``learned_obstacles_training.proposals`` does the same in torch."""
    path = path_of(plan)
    value: Floats = inputs_of(path).astype(np.float64)
    for i in range(len(CHANNELS)):
        padded = np.pad(value, ((0, 0), (KERNEL // 2, KERNEL // 2)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, KERNEL, axis=1)[:, ::2]
        value = np.einsum("clk,ock->ol", windows, weights[f"convolution.{i}.weight"])
        value = np.maximum(value + weights[f"convolution.{i}.bias"][:, np.newaxis], 0.0)
    raw = weights["linear.weight"] @ value.ravel() + weights["linear.bias"]
    raw = raw.reshape(2, OBSTACLES, 3)
    scale = np.array([PLACE_STD_M, PLACE_STD_M, RADIUS_STD])
    centre = np.column_stack((anchors_of(path), np.full(OBSTACLES, np.log(RADIUS_M))))
    return Proposal(centre + scale * raw[0], scale * (SMALLEST_STD + np.exp(raw[1])))


@jit
def _polygons(drawn: Floats, boxes: Floats, smallest_m: float, rng: np.random.Generator) -> Obstacles:
    """Regular polygons ``drawn [K, 3]``, each no larger than ``boxes [S, 6]`` allow."""
    canvas = new_canvas()
    for k in range(drawn.shape[0]):
        x = drawn[k, 0]
        y = drawn[k, 1]
        radius = min(np.exp(drawn[k, 2]), clear_of(x, y, boxes, smallest_m) - 1e-3)  # room for rounding
        if radius > smallest_m:
            add_regular(canvas, x, y, 2.0 * np.pi * rng.random(), radius, int(rng.integers(5, 11)))
            canvas.counts[1] += 1
            canvas.obstacle_starts[canvas.counts[1]] = canvas.counts[0]
    return finished(canvas)
