from __future__ import annotations

import pickle

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.encoder.encoder import Architecture, Encoder, initial_weights, layer_counts, to_onnx
from planners.memory.encoder.forward_pass import forward_of
from planners.memory.encoder.torch_network import embed, unpacked
from planners.world.geometry.occupancy import bits_of
from planners.world.randomness import generator

ARCHITECTURES = [
    Architecture(),
    Architecture(channels=(4,), hidden=(), dimensions=3),
    Architecture(channels=(4, 6, 5), hidden=(17,), dimensions=30),
]


def random_grids(count, seed=0):
    return (generator(seed, "grids").random((count, 64, 64)) < 0.2).astype(np.uint8)


def random_weights(architecture):
    rng = generator(1, "weights")
    weights = initial_weights(architecture, rng)
    return {k: (v + 0.05 * rng.standard_normal(v.shape)).astype(np.float32) for k, v in weights.items()}


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_the_runtime_embeds_as_torch_does(architecture):
    weights = random_weights(architecture)
    grids = random_grids(9)
    with torch.no_grad():
        bits = torch.from_numpy(np.packbits(grids.reshape(9, -1), axis=1))
        expected = embed({k: torch.from_numpy(v) for k, v in weights.items()}, bits).numpy()
    embeddings = Encoder(to_onnx(weights))(grids)
    assert embeddings.shape == (9, architecture.dimensions)
    np.testing.assert_allclose(embeddings, expected, atol=1e-5)


def patchy_grids(count, seed):
    """Grids with empty, full and mixed patches."""
    rng = generator(seed, "patchy")
    coarse = rng.random((count, 16, 16, 1, 1))
    fine = rng.random((count, 16, 16, 4, 4)) < rng.uniform(0.05, 0.9, (count, 16, 16, 1, 1))
    cells = np.where(coarse < 0.4, 0, np.where(coarse < 0.5, 1, fine))
    return cells.transpose(0, 1, 3, 2, 4).reshape(count, 64, 64).astype(np.uint8)


@given(
    channels=st.lists(st.integers(1, 20), min_size=1, max_size=2).map(tuple),
    hidden=st.lists(st.integers(1, 70), max_size=3).map(tuple),
    dimensions=st.integers(1, 40),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=40, deadline=None)
def test_the_forward_pass_embeds_as_the_runtime_does(channels, hidden, dimensions, seed):
    rng = generator(seed, "weights")
    weights = initial_weights(Architecture(channels, hidden, dimensions), rng)
    weights = {k: (v + 0.05 * rng.standard_normal(v.shape)).astype(np.float32) for k, v in weights.items()}
    grids = patchy_grids(3, seed)
    expected = Encoder(to_onnx(weights))(grids)
    forward = forward_of(weights)
    embeddings = np.array([forward(bits) for bits in bits_of(grids)])
    assert np.abs(embeddings - expected).max() < 1e-4 * max(1.0, np.abs(expected).max())


def test_bits_unpack_to_the_grids_they_were_packed_from():
    grids = random_grids(3)
    bits = torch.from_numpy(np.packbits(grids.reshape(3, -1), axis=1))
    assert (unpacked(bits)[:, 0].numpy() == grids).all()


def test_one_grid_embeds_as_it_does_among_others():
    encoder = Encoder(to_onnx(random_weights(Architecture())))
    grids = random_grids(5)
    np.testing.assert_allclose(encoder(grids[2]), encoder(grids)[2], atol=1e-6)


def test_an_encoder_survives_pickling_after_use():
    encoder = Encoder(to_onnx(random_weights(Architecture())))
    grid = random_grids(1)[0]
    expected = encoder(grid)
    assert (pickle.loads(pickle.dumps(encoder))(grid) == expected).all()


def test_the_same_weights_give_the_same_bytes():
    weights = random_weights(Architecture())
    assert to_onnx(weights) == to_onnx(weights)


def test_layers_are_counted():
    assert layer_counts(initial_weights(ARCHITECTURES[2], generator(0))) == (3, 2)


@pytest.mark.parametrize("grid", [np.zeros((50, 50), np.uint8), np.zeros((64, 64)), np.zeros(512, np.uint8)])
def test_a_wrong_grid_is_refused(grid):
    with pytest.raises(ValueError, match="the encoder needs uint8"):
        Encoder(to_onnx(random_weights(Architecture())))(grid)


@pytest.mark.parametrize(
    "sizes", [{"channels": ()}, {"channels": (8, -1)}, {"hidden": (0,)}, {"dimensions": 0}]
)
def test_sizes_that_make_no_network_are_refused(sizes):
    with pytest.raises(ValueError, match=r"give (1 or more|the channels)"):
        Architecture(**sizes)
