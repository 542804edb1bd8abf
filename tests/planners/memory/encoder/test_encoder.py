from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.encoder.encoder import (
    Architecture,
    Encoder,
    architecture_of,
    initial_weights,
    layer_counts,
    to_onnx,
)
from planners.memory.encoder.forward_pass import forward_of
from planners.memory.encoder.torch_network import embed, unpacked
from planners.world.geometry.occupancy import bits_of
from planners.world.randomness import generator

ARCHITECTURES = [
    Architecture(),
    Architecture(channels=(4,), hidden=(), dimensions=3),
    Architecture(channels=(4, 6, 5), hidden=(17,), dimensions=30),
    Architecture((8, 16, 32), (128, 64), 30, "pooled"),  # the paper's
    Architecture((3,), (), 2, "pooled"),
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


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_weights_say_which_network_they_are_of(architecture):
    assert architecture_of(random_weights(architecture)) == architecture


def published_embedding(weights, grid):
    """The paper's network by torch's own modules, written without a look at ``embed``: 50x50 cells."""
    cells = np.zeros((50, 50), np.float32)
    for row, column in zip(*np.nonzero(grid), strict=True):  # to where the cell's centre lies
        cells[int((row + 0.5) * 50 / 64), int((column + 0.5) * 50 / 64)] = 1.0
    layers = []
    for inputs, outputs in itertools.pairwise((1, 8, 16, 32)):
        layers += [
            torch.nn.Conv2d(inputs, outputs, 3, padding=1),
            torch.nn.PReLU(outputs),
            torch.nn.MaxPool2d(2),
        ]
    layers.append(torch.nn.Flatten())
    for inputs, outputs in itertools.pairwise((32 * 6 * 6, 128, 64, 30)):
        layers += [torch.nn.Linear(inputs, outputs), torch.nn.PReLU(outputs)]
    network = torch.nn.Sequential(*layers[:-1])
    names = [
        f"{kind}.{i}.{part}"
        for kind in ("convolution", "linear")
        for i in range(3)
        for part in ("weight", "bias", "slope")
    ]
    values = [torch.from_numpy(weights[name]) for name in names if name in weights]
    with torch.no_grad():
        for parameter, value in zip(network.parameters(), values, strict=True):
            parameter.copy_(value.reshape(parameter.shape))
        return network(torch.from_numpy(cells)[None, None])[0].numpy()


@pytest.mark.parametrize("seed", range(3))
def test_the_published_network_is_three_stages_of_convolution_prelu_and_pooling(seed):
    weights = random_weights(ARCHITECTURES[3])
    grids = patchy_grids(3, seed)
    expected = np.array([published_embedding(weights, grid) for grid in grids])
    np.testing.assert_allclose(Encoder(to_onnx(weights))(grids), expected, atol=1e-5)
    forward = forward_of(weights)
    np.testing.assert_allclose([forward(bits) for bits in bits_of(grids)], expected, atol=1e-4)


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
    "sizes",
    [
        {"channels": ()},
        {"channels": (8, -1)},
        {"hidden": (0,)},
        {"dimensions": 0},
        {"channels": (2,) * 6, "network": "pooled"},
        {"network": "dense"},
    ],
)
def test_sizes_that_make_no_network_are_refused(sizes):
    with pytest.raises(
        ValueError, match=r"give (1 or more|the channels|fewer)|choose one of patches, pooled"
    ):
        Architecture(**sizes)
