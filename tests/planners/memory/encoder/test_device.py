from __future__ import annotations

import pytest
import torch

from planners.memory.encoder.device import forward_on
from planners.memory.encoder.encoder import Architecture, initial_weights
from planners.memory.encoder.torch_network import embed
from planners.world.randomness import generator


def test_without_a_gpu_the_encoder_runs_as_it_is() -> None:
    assert forward_on(torch.device("cpu")) is embed


def test_mixed_precision_gives_gradients_and_nearly_the_same_embeddings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(torch, "compile", lambda function: function)  # which takes a compiler and a minute
    monkeypatch.setattr(torch, "autocast", lambda _, kind: _autocast("cpu", kind))
    weights = initial_weights(Architecture(), generator(0, "weights"))
    parameters = {name: torch.from_numpy(value).requires_grad_(True) for name, value in weights.items()}
    bits = torch.from_numpy(generator(1).integers(0, 256, (6, 512), "uint8"))
    exact, mixed = embed(parameters, bits), forward_on(torch.device("cuda"))(parameters, bits)
    assert mixed.dtype == torch.float32
    assert not torch.equal(exact, mixed)
    torch.testing.assert_close(exact, mixed, rtol=0.05, atol=0.05 * float(exact.detach().std()))
    torch.autograd.backward(mixed.sum())
    assert all(value.grad is not None for value in parameters.values())


_autocast = torch.autocast
