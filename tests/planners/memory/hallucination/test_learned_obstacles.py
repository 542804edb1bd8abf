from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from planners.memory.hallucination.learned_obstacles import (
    OBSTACLES,
    PLACE_STD_M,
    POINTS,
    RADIUS_M,
    RADIUS_STD,
    Learned,
    anchors_of,
    inputs_of,
    path_of,
    propose,
)
from planners.memory.hallucination.learned_obstacles_training import (
    LearnedTraining,
    _smoothing,
    planned,
    proposals,
    train_learned,
)
from planners.world.problem import obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.bodies import box_corners

SHORT = LearnedTraining(steps=20)


@pytest.fixture(scope="module")
def weights(experiences):
    return train_learned(experiences, 1, SHORT)


def test_the_same_seed_trains_the_same_weights(experiences, weights):
    again, other = train_learned(experiences, 1, SHORT), train_learned(experiences, 2, SHORT)
    assert all((weights[name] == again[name]).all() for name in weights)
    assert any((weights[name] != other[name]).any() for name in weights)


def test_workers_propose_what_was_trained_without_torch(experiences, weights):
    tensors = {name: torch.from_numpy(value) for name, value in weights.items()}
    ways = np.stack([path_of(experience.plan) for experience in experiences])
    means, deviations = proposals(tensors, torch.from_numpy(inputs_of(ways)))
    scale = np.array([PLACE_STD_M, PLACE_STD_M, RADIUS_STD])
    for i, experience in enumerate(experiences):
        proposal = propose(weights, experience.plan)
        centre = np.column_stack((anchors_of(ways[i]), np.full(OBSTACLES, np.log(RADIUS_M))))
        np.testing.assert_allclose(proposal.means, centre + scale * means[i].numpy(), atol=1e-4)
        np.testing.assert_allclose(proposal.deviations, scale * deviations[i].numpy(), rtol=1e-4)


def test_a_way_is_resampled_evenly_between_its_ends(experiences):
    states = experiences[0].plan.states
    way = path_of(experiences[0].plan)
    assert way.shape == (POINTS, 2)
    np.testing.assert_allclose(way[[0, -1]], states[[0, -1], :2])
    steps = np.hypot(*np.diff(way, axis=0).T)
    assert steps.max() < 1.05 * steps.min()


def bent(height: float) -> torch.Tensor:
    along = torch.linspace(0.0, 50.0, POINTS)
    return torch.stack((along, height * torch.sin(along * np.pi / 50.0)), 1)[None]


def test_without_obstacles_a_plan_relaxes_to_the_straight_line():
    far, radii = torch.full((1, OBSTACLES, 2), -100.0), torch.ones((1, OBSTACLES))
    made = planned(bent(6.0), far, radii, torch.from_numpy(_smoothing()), LearnedTraining())
    assert made[..., 1].abs().max() < 0.5


def test_a_disc_in_the_bend_holds_it():
    centres = torch.full((1, OBSTACLES, 2), -100.0)
    centres[0, 0] = torch.tensor([25.0, 2.0])
    radii = torch.full((1, OBSTACLES), 3.0)
    made = planned(bent(6.0), centres, radii, torch.from_numpy(_smoothing()), LearnedTraining())
    assert made[0, POINTS // 2, 1] > 4.0
    assert (made[0, [0, -1]] == bent(6.0)[0, [0, -1]]).all()


def test_training_finds_obstacles_that_hold_plans():
    """Plans that bend to either side: after training their proposals keep them nearly as they are."""

    def reconstruction(settings: LearnedTraining) -> float:
        weights = {name: torch.from_numpy(value) for name, value in train_learned(bends, 3, settings).items()}
        means, _ = proposals(weights, torch.from_numpy(inputs_of(ways)))
        centres = torch.from_numpy(anchors_of(ways).astype(np.float32)) + PLACE_STD_M * means[..., :2]
        radii = RADIUS_M * torch.exp(RADIUS_STD * means[..., 2])
        way = torch.from_numpy(ways.astype(np.float32))
        made = planned(way, centres, radii, torch.from_numpy(_smoothing()), settings)
        return float((made - way).square().sum(2).mean().sqrt())

    bends = [_Bent(height) for height in (-12.0, -8.0, 8.0, 12.0)]
    ways = np.stack([path_of(bend.plan) for bend in bends])
    assert reconstruction(LearnedTraining(steps=200)) < 0.6 * reconstruction(LearnedTraining(steps=0))


class _Bent:
    """Looks like an experience to the training: a plan along an arc from start to goal."""

    def __init__(self, height: float) -> None:
        along = np.linspace(0.0, 1.0, 200)
        beside = height * np.sin(np.pi * along) / np.sqrt(2.0)
        states = np.zeros((200, 5))
        states[:, 0], states[:, 1] = 50.0 * along - beside, 50.0 * along + beside
        self.plan = type("Plan", (), {"states": states})


@given(seed=st.integers(0, 2**32 - 1), which=st.integers(0, 7))
@settings(max_examples=20)
def test_polygons_are_drawn_anew_and_clear_of_the_sweep(experiences, weights, seed, which):
    sample = Learned(weights).around(experiences[which], generator(seed))
    rng = generator(seed, "sample")
    first, second = (sample(lambda _: obstacles_of([]), rng).vertices for _ in range(2))
    assert first.shape != second.shape or (first != second).any()
    sweep = [Polygon(box) for box in box_corners(experiences[which].boxes.reshape(-1, 6)).reshape(-1, 4, 2)]
    for piece in sample(lambda _: obstacles_of([]), generator(seed)).pieces():
        assert not any(Polygon(piece).intersects(box) for box in sweep)


def test_a_polygon_without_room_is_left_out(experiences, weights):
    on_the_plan = {name: np.zeros_like(value) for name, value in weights.items()}
    on_the_plan["linear.bias"][3 * OBSTACLES :] = -20.0
    sample = replace(Learned(weights), weights=on_the_plan).around(experiences[0], generator(0))
    assert sample(lambda _: obstacles_of([]), generator(1)).pieces() == []
